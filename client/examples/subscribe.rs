// Live poses of one glove in Rust, with its standard library alone: by the WebSocket bridge, in the wire's own
// format (client/glovecal_client/wire/README.md).
//
//   glovecal bridge websocket &
//   rustc -O subscribe.rs && ./subscribe 127.0.0.1:8766 right
use std::error::Error;
use std::io::{Read, Write};
use std::net::TcpStream;

const LARGEST: u64 = 1 << 20;

fn shaken(address: &str, glove: &str) -> Result<TcpStream, Box<dyn Error>> {
    let mut opened = TcpStream::connect(address)?;
    write!(
        opened,
        "GET /binary/{glove} HTTP/1.1\r\nHost: {address}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
         Sec-WebSocket-Key: Z2xvdmVjYWwgZXhhbXBsZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
    )?;
    let mut answer = Vec::new();
    while !answer.ends_with(b"\r\n\r\n") {
        let mut byte = [0];
        opened.read_exact(&mut byte)?;
        answer.push(byte[0]);
    }
    let answer = String::from_utf8_lossy(&answer).into_owned();
    match answer.starts_with("HTTP/1.1 101") {
        true => Ok(opened),
        false => Err(answer.lines().next().unwrap_or("").into()),
    }
}

/// The next message's kind and bytes.
fn message(opened: &mut TcpStream) -> Result<(u8, Vec<u8>), Box<dyn Error>> {
    let mut head = [0; 2];
    opened.read_exact(&mut head)?;
    let mut size = vec![0; match head[1] & 127 { 126 => 2, 127 => 8, _ => 0 }];
    opened.read_exact(&mut size)?;
    let length = match size.is_empty() {
        true => u64::from(head[1] & 127),
        false => size.iter().fold(0, |length, byte| length << 8 | u64::from(*byte)),
    };
    if length > LARGEST {
        return Err("that is no bridge of Glovecal".into());
    }
    let mut body = vec![0; length as usize];
    opened.read_exact(&mut body)?;
    Ok((head[0] & 15, body))
}

/// Names of the rotations in the text that explains a glove's poses: its only list of texts called so.
fn names(text: &str) -> Vec<String> {
    let list = text.split_once("\"rotations\": [\"").map_or("", |(_, rest)| rest);
    list.split(']').next().unwrap_or("").split(',')
        .map(|name| name.trim().trim_matches('"').to_owned()).filter(|name| !name.is_empty()).collect()
}

fn float(pose: &[u8], offset: usize) -> f32 {
    f32::from_le_bytes([pose[offset], pose[offset + 1], pose[offset + 2], pose[offset + 3]])
}

/// A pose as a line; None for what is none.
fn shown(pose: &[u8], names: &[String]) -> Option<String> {
    if pose.len() < 92 || !pose.starts_with(b"GLVP\x01") {
        return None;
    }
    let count = usize::from(u16::from_le_bytes([pose[6], pose[7]]));
    if pose.len() != 92 + 9 * count {
        return None;
    }
    let mut line = u64::from_le_bytes(pose[8..16].try_into().ok()?).to_string();
    for (bit, word) in [(1, " uncalibrated"), (2, " stale")] {
        line += if pose[5] & bit != 0 { word } else { "" };
    }
    for (number, name) in names.iter().take(count).enumerate() {
        let (degrees, deviation) = (float(pose, 88 + 4 * number), float(pose, 88 + 4 * (count + number)));
        let is_usable = pose[88 + 8 * count + number] & (2 | 8) == 0; // too uncertain, faulty sensor
        line += &format!(" {name} {degrees:.2}+-{deviation:.2}{}", if is_usable { "" } else { "!" });
    }
    Some(line)
}

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().collect();
    let word = |number: usize, usual: &str| words.get(number).cloned().unwrap_or(usual.to_owned());
    let mut opened = shaken(&word(1, "127.0.0.1:8766"), &word(2, "right"))?;
    let mut known = Vec::new();
    loop {
        match message(&mut opened)? {
            (1, body) => known = names(&String::from_utf8_lossy(&body)),
            (2, body) => shown(&body, &known).iter().for_each(|line| println!("{line}")),
            (8, _) => return Ok(()),
            (9, body) if body.len() < 126 => {
                let head = [0x8A, 0x80 | body.len() as u8, 0, 0, 0, 0]; // a mask of zeros: its own bytes back
                opened.write_all(&[&head[..], &body[..]].concat())?;
            }
            _ => {}
        }
    }
}
