"""``glovecal emulate``: a glove that is not there, for trying a driver and what follows it."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand

from glovecal_service.cli.terminal.printing import out

if TYPE_CHECKING:
    from glovecal_service.emulators.catalogue import Protocol
    from glovecal_service.emulators.ports import Port


class WithFaults(TyperCommand):
    """Its help ends with the faults of every protocol."""

    def format_help(self, ctx: Any, formatter: Any) -> None:
        from glovecal_service.emulators.catalogue import PROTOCOLS

        explained = {fault: text for each in PROTOCOLS.values() for fault, text in each.faults.items()}
        lines = [f"Protocols: {', '.join(PROTOCOLS)}."]
        for fault, text in explained.items():
            names = [name for name, each in PROTOCOLS.items() if fault in each.faults]
            which = "every protocol" if len(names) == len(PROTOCOLS) else ", ".join(names)
            lines.append(f"Fault {fault} ({which}): {text}.")
        self.epilog = "\n\n".join(lines)
        super().format_help(ctx, formatter)


def emulate(
    protocol: Annotated[str, typer.Argument(help="Which glove, see below.", show_default=False)],
    port: Annotated[
        Path | None, typer.Option(help="Name of the emulated serial port. Default: a new one.")
    ] = None,
    tcp: Annotated[
        str | None, typer.Option(help="HOST:PORT to connect to, as a wireless glove does.")
    ] = None,
    udp: Annotated[str | None, typer.Option(help="HOST:PORT to send datagrams to.")] = None,
    fault: Annotated[list[str] | None, typer.Option(help="A fault, see below; repeatable.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Another is another hand, and other faults.")] = 0,
    seconds: Annotated[float | None, typer.Option(min=0.1, help="Default: until Ctrl-C.")] = None,
) -> None:
    """Emulate a glove, byte by byte, moved by the simulated hand. Ctrl-C stops it."""
    from glovecal_service.emulators import catalogue
    from glovecal_service.emulators.hand import MovingHand
    from glovecal_service.emulators.ports import Emulation

    chosen = catalogue.protocol(protocol)
    faults = catalogue.faults_of(protocol, fault or [], seed)
    with tempfile.TemporaryDirectory(prefix="glovecal-") as folder:
        place = _place(protocol, chosen, port, tcp, udp, Path(folder))
        glove = chosen.make(MovingHand(seed), faults, tcp is not None)
        with Emulation(glove, place, faults):
            _explain(protocol, chosen, place.name, tcp or udp, faults.names)
            until = float("inf") if seconds is None else time.monotonic() + seconds
            try:
                while time.monotonic() < until:
                    time.sleep(min(0.2, max(0.0, until - time.monotonic())))
            except KeyboardInterrupt:
                out.print("Stopped.")


def _place(
    name: str, chosen: Protocol, port: Path | None, tcp: str | None, udp: str | None, folder: Path
) -> Port:
    from glovecal_service.emulators.ports import TcpDialer, UdpSender
    from glovecal_service.emulators.pseudo_terminal import PseudoTerminal

    if sum(each is not None for each in (port, tcp, udp)) > 1:
        raise typer.BadParameter("give one of --port, --tcp and --udp")
    kind = "tcp" if tcp is not None else "udp" if udp is not None else "port"
    if kind not in chosen.links:
        possible = " or ".join(f"--{link}" for link in chosen.links)
        raise typer.BadParameter(f"{name} is emulated with {possible} alone")
    if tcp is not None or udp is not None:
        host, _, number = (tcp or udp or "").rpartition(":")
        if not host or not number.isdigit() or not 0 < int(number) < 65536:
            raise typer.BadParameter(f"{tcp or udp!r} must be HOST:PORT, as in 127.0.0.1:65432")
        return TcpDialer(host, int(number)) if tcp is not None else UdpSender(host, int(number))
    return PseudoTerminal(port or folder / f"emulated-{name}")


def _explain(name: str, chosen: Protocol, place: str, address: str | None, faults: set[str]) -> None:
    """Where it is, and the command that captures it; a network glove is marked by an option."""
    out.print(f"Emulated {name} at {place}; every reading is simulated.")
    for fault in sorted(faults):
        out.print(f"Fault {fault}: {chosen.faults[fault]}.")
    if address is not None:
        place = f"{place.partition(':')[0]}:{address.rpartition(':')[2]}"
    marked = (
        "" if Path(place).name.startswith("emulated-") or name == "cyberglove" else " --option simulated=yes"
    )
    device = chosen.device.format(port=place)
    out.print(f"glovecal capture --device {device}{marked} --glove right", soft_wrap=True, markup=False)
    if chosen.note:
        out.print(f"\n{chosen.note}", markup=False, highlight=False)
