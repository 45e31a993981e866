"""A hand in MuJoCo that follows a glove through the teleoperator, headless, recorded as a LeRobot dataset.

    glovecal subject robot anna hand.xml
    python mujoco_hand.py hand.xml dataset --glove right --seconds 10

Any MJCF will do: ``--robot shadow`` (allegro, leap, or its URDF) for one that is such a hand; ``--map FILE``
says of which rotations each of its joints (or actuators) is made, as the teleoperator's ``actions``; without
either joints follow the rotations whose names they have. Needs ``mujoco`` and ``pyarrow`` beside LeRobot and
the plug-in. When the glove cannot be trusted the recording ends there.
"""

# pyright: reportAttributeAccessIssue=false, reportMissingImports=false

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from pathlib import Path

import mujoco
import numpy as np
from dataset_v3 import Episode, write_dataset
from lerobot_teleoperator_glovecal.joint_actions import GloveNotUsable, JointAction

from glovecal_client.errors import ClientError
from lerobot_teleoperator_glovecal import GlovecalTeleoperator, GlovecalTeleoperatorConfig

SUFFIX = ".pos"
SERVO = 1.0
"""N m a radian, of joints that the model has no actuator for."""


class MujocoHand:
    """A robot as LeRobot knows them: ``NAME.pos`` is what the actuator NAME is told, or the joint NAME, which
    then gets a position servo, radians; such a hand weighs nothing."""

    def __init__(self, model: Path, names: list[str] | None = None) -> None:
        """``names``: of its actions; None: of every hinge that no equality holds. Raises ValueError."""
        spec = mujoco.MjSpec.from_file(str(model))
        held = {equality.name1 for equality in spec.equalities}
        hinges = {joint.name: joint for joint in spec.joints if joint.type == mujoco.mjtJoint.mjJNT_HINGE}
        driven = {actuator.name for actuator in spec.actuators}
        if names is None:
            names = [f"{name}{SUFFIX}" for name in hinges if name not in held]
        for actuator in list(spec.actuators):
            if f"{actuator.name}{SUFFIX}" not in names:
                spec.delete(actuator)  # two that are told apart would pull against each other
        for name in (each.removesuffix(SUFFIX) for each in names):
            if name not in driven and name not in hinges:
                raise ValueError(f"{model.name} has no joint or actuator {name}; it has {', '.join(hinges)}")
            if name not in driven:
                servo = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
                servo.set_to_position(kp=SERVO, dampratio=1.0)
                for body in spec.bodies:  # which way is down no glove tells
                    body.gravcomp = 1.0
        self.limits = {
            name: tuple(joint.range) if joint.limited else (-math.pi, math.pi)
            for name, joint in hinges.items()
        }
        self.action_features = dict.fromkeys(names, float)
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        self._actuators = [self._model.actuator(name.removesuffix(SUFFIX)).id for name in names]
        mujoco.mj_forward(self._model, self._data)

    def get_observation(self) -> dict[str, float]:
        """How long each actuator is: of a joint's, its angle."""
        lengths = self._data.actuator_length[self._actuators].tolist()
        return dict(zip(self.action_features, lengths, strict=True))

    def send_action(self, action: dict[str, float], seconds: float) -> None:
        """Tell it, and let so much time pass."""
        self._data.ctrl[self._actuators] = [action[name] for name in self.action_features]
        for _ in range(max(1, round(seconds / self._model.opt.timestep))):
            mujoco.mj_step(self._model, self._data)


def own_rotations(hand: MujocoHand) -> dict[str, JointAction]:
    """Each joint follows the rotation of its name, as in the hands that ``glovecal subject robot`` writes."""
    actions = {}
    for name in hand.action_features:
        rotation = name.removesuffix(SUFFIX)
        low, high = hand.limits[rotation]
        actions[name] = JointAction({rotation: math.pi / 180}, low=float(low), high=float(high))
    return actions


def record(
    teleoperator: GlovecalTeleoperator, hand: MujocoHand, seconds: float, fps: int
) -> tuple[Episode, str]:
    """What the hand was and was told, until ``seconds`` are over or the glove cannot be trusted: then why."""
    states, actions, why = [], [], ""
    began = time.monotonic()
    for number in range(round(seconds * fps)):
        time.sleep(max(0.0, began + number / fps - time.monotonic()))
        try:
            action = teleoperator.get_action()
        except GloveNotUsable as error:
            why = str(error)
            break
        states.append(list(hand.get_observation().values()))
        actions.append([action[name] for name in hand.action_features])
        hand.send_action(action, 1 / fps)
    return Episode(np.array(states, np.float32), np.array(actions, np.float32)), why


def main(words: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("model", type=Path, help="the hand, MJCF")
    parser.add_argument("dataset", type=Path, help="folder to write; must not exist")
    parser.add_argument("--map", type=Path, help="JSON: the teleoperator's actions by the model's joints")
    parser.add_argument("--robot", default="", help="what hand it is: shadow, allegro, leap or a URDF file")
    parser.add_argument("--side", default="right", help="of the robot's hand: right or left")
    parser.add_argument("--glove", default="right")
    parser.add_argument("--connect", default="tcp/127.0.0.1:7447", help="the service's zenoh endpoint")
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--fps", type=int, default=30)
    parser.add_argument(
        "--hold", type=float, default=0.2, help="seconds without a pose to trust until it ends"
    )
    parser.add_argument("--task", default="move the hand")
    parser.add_argument("--allow-simulated", action="store_true", help="follow a simulated glove")
    options = parser.parse_args(words)
    if options.dataset.exists():
        parser.error(f"{options.dataset} is there already; name another folder")
    mapped = None
    if options.map is not None:
        written = json.loads(options.map.read_text(encoding="utf-8"))
        mapped = {name: JointAction(**action) for name, action in written.items()}
    config = GlovecalTeleoperatorConfig(
        glove=options.glove, actions=mapped or {}, robot=options.robot, side=options.side,
        connect=options.connect, allow_simulated=options.allow_simulated, hold_s=options.hold,
    )  # fmt: skip
    if options.robot:
        teleoperator = GlovecalTeleoperator(config)
        hand = MujocoHand(options.model, list(teleoperator.action_features))
    else:
        hand = MujocoHand(options.model, None if mapped is None else list(mapped))
        config.actions = mapped or own_rotations(hand)
        teleoperator = GlovecalTeleoperator(config)
    try:
        teleoperator.connect()
        episode, why = record(teleoperator, hand, options.seconds, options.fps)
    except (GloveNotUsable, ClientError) as error:
        print(f"Nothing is recorded: {error}", file=sys.stderr)
        return 1
    finally:
        teleoperator.disconnect()
    names = list(hand.action_features)
    if len(episode.actions):
        write_dataset(
            options.dataset,
            [episode],
            names=names,
            fps=options.fps,
            task=options.task,
            robot=options.model.stem,
        )
        print(f"{len(episode.actions)} frames of {len(names)} joints in {options.dataset}.")
    if why:
        print(f"It ended early: {why}", file=sys.stderr)
    return 1 if why else 0


if __name__ == "__main__":
    sys.exit(main())
