"""MCAP, the recording of robotics: joint states as ROS 2 sends them (extra ``mcap``).

One topic a hand with ``sensor_msgs/msg/JointState``, as the live bridge sends it, and one with the same
message for each of standard deviations and flags as positions. Angles and deviations are radians; what is
not known is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from glovecal_service.bridges.ros2 import joint_state
from glovecal_service.exports.body_motion import SIDES
from glovecal_service.exports.hand_motion import ALL_CHANNELS, Content, ExportFormat, HandMotion

CHUNK_BYTES = 1 << 15
"""That are held until they are written."""
TOPICS = {"sd": "deviations", "flags": "flags"}
TYPE = "sensor_msgs/msg/JointState"
_BETWEEN = "=" * 80
DEFINITION = f"""std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
{_BETWEEN}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{_BETWEEN}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


def write_mcap(motions: Sequence[HandMotion], content: Content, path: Path) -> None:
    """Hands on one time; log times are nanoseconds since the first frame. Raises BadInput."""
    from mcap.writer import Writer  # an extra

    for motion in motions:
        motion.require_angles(content)
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=CHUNK_BYTES)
        writer.start(profile="ros2", library="glovecal")
        schema = writer.register_schema(TYPE, "ros2msg", DEFINITION.encode())
        channels = []
        for motion in motions:
            side = SIDES[motion.label].lower()
            topics = {"joint_states": np.radians(motion.degrees)}
            topics |= {
                TOPICS[channel.name]: np.radians(channel.values) if channel.unit else channel.values
                for channel in motion.channels
            }
            channels += [
                (writer.register_channel(f"/glovecal/{side}/{topic}", "cdr", schema), motion, values, side)
                for topic, values in topics.items()
            ]
            notes = {"simulated": str(motion.simulated)}
            notes |= {name: str(value) for name, value in motion.notes.items()}
            writer.add_metadata(f"glovecal {side}", notes)
        time_ns = np.round((motions[0].time_s - motions[0].time_s[0]) * 1e9).astype(np.int64).tolist()
        for frame, at_ns in enumerate(time_ns):
            for channel, motion, values, side in channels:
                row = zip(motion.rotations, values[frame].tolist(), strict=True)
                known = {name: float(value) for name, value in row if value == value}
                writer.add_message(channel, at_ns, joint_state(at_ns, side, known), at_ns, frame)
        writer.finish()


FORMAT = ExportFormat(
    ".mcap", "application/octet-stream", write_mcap, ("angles",), "MCAP (sensor_msgs/JointState)",
    unit="radians", axes="none: angles by name", times="the frames' own",
    accuracy=ALL_CHANNELS, read_by="Foxglove, ros2 bag, rerun", needs=("mcap", "mcap"),
)  # fmt: skip
