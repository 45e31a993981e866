"""``glovecal site``: the authority of a site, and the files with which its members prove who they are."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any

import typer

from glovecal_client.operating_system import move_over
from glovecal_client.private_files import keep_private, open_private
from glovecal_client.site.member import Kind, Member, read_member
from glovecal_client.site.roles import Role
from glovecal_models.errors import BadInput
from glovecal_service.cli.terminal.connection import settings_of_environment
from glovecal_service.cli.terminal.options import AsJson, identifier
from glovecal_service.cli.terminal.printing import Refusal, out, print_json, print_table, sentence_of
from glovecal_service.settings import Settings
from glovecal_service.store.site.site_folder import Row, SiteFolder

app = typer.Typer(help="Several computers: who belongs to the site.", no_args_is_help=True)

Name = Annotated[str, typer.Argument(help="The member's name.", callback=identifier("member"))]
Hosts = Annotated[
    list[str] | None,
    typer.Option("--host", help="Name or address by which other computers reach the service; repeatable."),
]
AuthorityKey = Annotated[
    Path | None,
    typer.Option("--authority-key", help="Where the authority's private key was moved to.", dir_okay=False),
]
Days = Annotated[int, typer.Option("--days", min=1, max=397, help="How long the certificate is valid.")]
To = Annotated[
    Path | None, typer.Option("--to", help="File to write, NAME.glovecal by default.", dir_okay=False)
]
COLUMNS = {
    "name": "member", "kind": "kind", "gloves": "gloves", "role": "role", "expires": "expires",
    "state": "state",
}  # fmt: skip


@app.command("init")
def init(host: Hosts = None) -> None:
    """Make this site's authority and the service's own certificate, in the folder site of GLOVECAL_DATA."""
    settings, folder = _place()
    port = _zenoh_port(settings)
    settings.data.mkdir(mode=0o700, parents=True, exist_ok=True)
    register = folder.begin(settings.site, tuple(host or ()), zenoh_port=port, rest_port=settings.port)
    elsewhere = f" GLOVECAL_HOST=0.0.0.0 GLOVECAL_ZENOH=tls/0.0.0.0:{port}" if host else ""
    out.print(
        f"Site {register.site} is in {folder.folder}. The service answers to {', '.join(register.hosts)}.\n"
        f"Start it: GLOVECAL_SITE_FILE={folder.service_file}{elsewhere} glovecal serve\n"
        "Add others: glovecal site add NAME --as capture (or viewer, worker)\n"
        f"Whoever has {folder.authority_key} can make members. To keep it elsewhere, move it away, and "
        "give its place to add and renew with --authority-key."
    )


@app.command("add")
def add(
    name: Name,
    kind: Annotated[Kind, typer.Option("--as", help="What it does: capture, viewer, worker or service.")],
    glove: Annotated[
        list[str] | None,
        typer.Option("--glove", help="Of a capture: the only gloves it may publish; repeatable."),
    ] = None,
    role: Annotated[
        Role | None,
        typer.Option("--role", help="Its role over REST: a key of its name is made and put into the file."),
    ] = None,
    to: To = None,
    days: Days = 397,
    authority_key: AuthorityKey = None,
) -> None:
    """Make the file of a new member: copy it to that computer and name it in GLOVECAL_SITE_FILE there."""
    settings, folder = _place()
    place = to or Path(f"{name}.glovecal")
    if place.exists():
        raise Refusal(f"{place} exists already; move it away, or choose another file with --to")
    member = folder.add(name, kind, gloves=glove or (), role=role, key=authority_key, days=days)
    _write(place, member, api_key=None if role is None else _key(settings, name, role))
    starts = f"; glovecal worker, which connects to {member.training}" if kind == "worker" else ""
    bound = f", gloves {', '.join(member.gloves)}" if member.gloves else ""
    out.print(
        f"Wrote {place}: {name}, {kind}{bound}. It holds a private key: copy it to that computer only, "
        "readable for its user only.\n"
        f"There: export GLOVECAL_SITE_FILE={place.name}{starts}"
    )


@app.command("list")
def list_members(as_json: AsJson = False) -> None:
    """Show the members, until when their certificates are valid, and who was revoked."""
    _, folder = _place()
    register = folder.register()
    rows = [_shown(row) for row in register.members]
    if as_json:
        print_json({"site": register.site, "hosts": list(register.hosts), "members": rows})
        return
    print_table(rows, COLUMNS, empty="No members.")


@app.command("revoke")
def revoke(name: Name) -> None:
    """Let a member do nothing any more. A running service knows within a second."""
    settings, folder = _place()
    row = folder.revoke(name)
    _revoke_key(settings, name)
    out.print(
        f"Revoked {name}. To let that computer in again, make it a new file: "
        f"glovecal site add {name} --as {row.kind}"
    )


@app.command("renew")
def renew(
    name: Annotated[
        str, typer.Argument(help="The member; the service itself by default.", callback=identifier("member"))
    ] = "service",
    host: Hosts = None,
    to: To = None,
    days: Days = 397,
    authority_key: AuthorityKey = None,
) -> None:
    """Make a new certificate and key for a member, with the rights it has; running programs take it.

    The service's own needs no restart either.
    """
    _, folder = _place()
    if host and name != "service":
        raise BadInput("hosts are of the service's certificate; leave the name out, or --host")
    if name == "service":
        member = folder.renew(name, hosts=tuple(host or ()), key=authority_key, days=days)
        out.print(f"Renewed {folder.service_file}, valid for {days} days.")
        return
    place = to or Path(f"{name}.glovecal")
    kept = read_member(place).api_key if place.exists() else None
    member = folder.renew(name, key=authority_key, days=days)
    _write(place, member, api_key=kept)
    out.print(f"Wrote {place}, valid for {days} days: put it in the place of the file on that computer.")


def _place() -> tuple[Settings, SiteFolder]:
    keep_private()
    settings = settings_of_environment()
    return settings, SiteFolder(settings.data, settings.worker_port)


def _key(settings: Settings, name: str, role: Role) -> str:
    from glovecal_service.store.store import Store

    with Store.open(settings) as store:
        return store.keys.create(name, role)[1]


def _revoke_key(settings: Settings, name: str) -> None:
    """The member's own, if it has one."""
    from glovecal_service.store.store import Store

    with Store.open(settings) as store:
        if any(key.name == name and key.is_valid for key in store.keys.list()):
            store.keys.revoke(name)


def _zenoh_port(settings: Settings) -> int:
    port = settings.zenoh.rpartition(":")[2]
    if not port.isdecimal():
        raise BadInput(f"GLOVECAL_ZENOH is {settings.zenoh!r}: a site needs a port, as in tls/0.0.0.0:7447")
    return int(port)


def _write(place: Path, member: Member, *, api_key: str | None = None) -> None:
    from dataclasses import replace

    unfinished = place.with_name(f".{place.name}.new")
    try:
        with open(unfinished, "w", encoding="utf-8", opener=open_private) as file:
            file.write(replace(member, api_key=api_key).document())
        move_over(unfinished, place)
    except OSError as error:
        raise Refusal(
            f"{place} cannot be written ({sentence_of(error)}); glovecal site renew {member.name} --to FILE "
            "writes it elsewhere"
        ) from error


def _shown(row: Row) -> dict[str, Any]:
    expires = datetime.fromisoformat(row.expires)
    left = (expires - datetime.now(UTC)).days
    if row.revoked is not None:
        state = "revoked"
    elif left < 0:
        state = "expired"
    else:
        state = f"{left} days left"
    return {
        "name": row.name,
        "kind": row.kind,
        "gloves": ", ".join(row.gloves) or None,
        "role": row.role,
        "expires": row.expires[:10],
        "state": state,
        "common_name": row.common_name,
    }
