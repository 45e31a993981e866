// Reads a frame or a pose, version 1, as described in client/glovecal_client/wire/README.md, and prints its
// values as JSON. Written from that document alone, with the standard library alone.
use std::fmt::Write;
use std::process::ExitCode;

fn crc32(bytes: &[u8]) -> u32 {
    let mut crc = u32::MAX;
    for byte in bytes {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = (crc >> 1) ^ (0xEDB8_8320 & (crc & 1).wrapping_neg());
        }
    }
    !crc
}

/// A message with a magic, version and checksum that are right.
struct Message<'a>(&'a [u8]);

impl<'a> Message<'a> {
    fn of(bytes: &'a [u8]) -> Option<Self> {
        let (body, checksum) = bytes.split_at(bytes.len().checked_sub(4)?);
        let is_whole = bytes.len() >= 48 && crc32(body) == u32::from_le_bytes(checksum.try_into().ok()?);
        (is_whole && bytes[4] == 1).then_some(Message(bytes))
    }

    /// `N` bytes at `offset`; the lengths were compared before.
    fn at<const N: usize>(&self, offset: usize) -> [u8; N] {
        self.0[offset..offset + N].try_into().expect("inside the message")
    }

    fn u16(&self, offset: usize) -> usize {
        usize::from(u16::from_le_bytes(self.at(offset)))
    }

    fn u32(&self, offset: usize) -> u32 {
        u32::from_le_bytes(self.at(offset))
    }

    fn u64(&self, offset: usize) -> u64 {
        u64::from_le_bytes(self.at(offset))
    }

    fn i64(&self, offset: usize) -> i64 {
        i64::from_le_bytes(self.at(offset))
    }

    fn floats(&self, offset: usize, count: usize) -> String {
        list((0..count).map(|number| match f32::from_le_bytes(self.at(offset + 4 * number)) {
            value if value.is_nan() => "null".to_owned(),
            value => value.to_string(),
        }))
    }

    fn common(&self) -> String {
        format!(
            "\"flags\": {}, \"sequence\": {}, \"monotonic_ns\": {}, \"wall_ns\": {}, \"run_id\": {}",
            self.0[5], self.u64(8), self.i64(16), self.i64(24), self.u64(32)
        )
    }

    fn frame(&self) -> Option<String> {
        let (sensors, contexts) = (self.u16(6), self.u16(40));
        let after = 44 + 4 * sensors;
        (self.0.len() == after + 4 * contexts + 4).then(|| {
            format!(
                "{{{}, \"readings\": {}, \"context\": {}}}",
                self.common(), self.floats(44, sensors), self.floats(after, contexts)
            )
        })
    }

    fn pose(&self) -> Option<String> {
        let rotations = self.u16(6);
        (self.0.len() == 92 + 9 * rotations).then(|| {
            let model = self.at::<32>(56).iter().fold(String::new(), |mut digits, byte| {
                write!(digits, "{byte:02x}").expect("a text grows");
                digits
            });
            let flags = &self.0[88 + 8 * rotations..88 + 9 * rotations];
            format!(
                "{{{}, \"skipped\": {}, \"age_us\": {}, \"model_sha256\": \"{model}\", \"degrees\": {}, \
                 \"deviations\": {}, \"rotation_flags\": {}}}",
                self.common(), self.u64(40), self.u32(48), self.floats(88, rotations),
                self.floats(88 + 4 * rotations, rotations), list(flags.iter().map(u8::to_string))
            )
        })
    }
}

fn list(items: impl Iterator<Item = String>) -> String {
    format!("[{}]", items.collect::<Vec<_>>().join(", "))
}

fn read(bytes: &[u8]) -> Option<String> {
    let message = Message::of(bytes)?;
    match &bytes[..4] {
        b"GLVF" => message.frame(),
        b"GLVP" => message.pose(),
        _ => None,
    }
}

fn main() -> ExitCode {
    let path = match std::env::args().nth(1) {
        Some(path) => path,
        None => return ExitCode::from(2),
    };
    match std::fs::read(path).ok().as_deref().and_then(read) {
        Some(text) => {
            println!("{text}");
            ExitCode::SUCCESS
        }
        None => ExitCode::FAILURE,
    }
}
