"""All that a service keeps, in one file that is written while it runs, and tried by restoring it.

A tar file: the database of one moment, as an SQLite file whichever holds it; then the artifacts it names and
the files of the data folder, as they lie there, encrypted or not; last a manifest with the sha256 of each.
Files that were written after the database's moment may be among them, and nobody names those.
"""

from __future__ import annotations

import hashlib
import io
import json
import secrets
import shutil
import tarfile
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Any

from sqlalchemy import Connection, delete, func, insert, select, text

from glovecal_client.operating_system import move_over, sync_file
from glovecal_client.private_files import PRIVATE_FOLDER, open_private
from glovecal_models.errors import BadInput, DamagedArtifact
from glovecal_service.settings import SQLITE_FILE, Settings
from glovecal_service.store import tables
from glovecal_service.store.belongings import artifacts_of
from glovecal_service.store.blobs import SHA256_NAME, full_disk_named
from glovecal_service.store.data_folder_lock import LOCK, WHO
from glovecal_service.store.database import Database
from glovecal_service.store.errors import DamagedRows, NotFound
from glovecal_service.store.row_hash import sound_rows
from glovecal_service.store.schema import upgrade
from glovecal_service.store.store import Store
from glovecal_service.store.tables import JsonText, metadata

FORMAT = "glovecal.backup.v1"
DATABASE, MANIFEST = "database.sqlite3", "manifest.json"
ARTIFACTS, FILES = "artifacts/", "files/"
_OF_A_PROCESS = (LOCK, WHO, "realtime.alive", "realtime.restarts")
_OF_ONE_RUN = ("artifacts", "artifacts-cache", "fits", "owners", "pulses")
"""Folders: artifacts come as the database names them, the others are of what begins anew."""
_UNFINISHED = (".writing-", ".unfinished", ".encrypting")
_ROWS_AT_ONCE = 500
_LARGEST_MANIFEST = 1 << 28


@dataclass(frozen=True)
class Backup:
    """What is in one; ``problems``: what is not as it was written, a sentence each."""

    written_at: datetime
    rows: dict[str, int]
    """By table."""
    artifacts: int
    files: int
    size_bytes: int
    problems: tuple[str, ...] = ()


def make_backup(store: Store, settings: Settings, target: Path) -> Backup:
    """Write ``target`` and try it. Raises BadInput where it is there already or lies in the data folder,
    StorageFull, StoreUnavailable, OSError; then there is no ``target``."""
    if target.exists():
        raise BadInput(f"{target} exists already; choose another file, backups are never overwritten")
    if target.resolve().is_relative_to(settings.data.resolve()):
        raise BadInput(f"{target} lies in the data folder {settings.data}: choose a place on another disk")
    unfinished = target.with_name(f".{target.name}.{secrets.token_hex(4)}")
    with full_disk_named(target.parent):
        try:
            with open(unfinished, "xb", opener=open_private) as file:
                _write(store, settings, file, unfinished.parent)
                file.flush()
                sync_file(file)
            made = check_backup(unfinished)
            move_over(unfinished, target, durably=True)
        except BaseException:
            unfinished.unlink(missing_ok=True)
            raise
    return made


def check_backup(source: Path) -> Backup:
    """Restore it to a folder beside it, read all that is in it, and remove the folder again.

    Raises BadInput for what is no backup, or damaged; UnknownSchema, StorageFull.
    """
    with tempfile.TemporaryDirectory(prefix=f".{source.name}.", dir=source.parent) as place:
        return restore_backup(source, Settings(data=Path(place) / "data", database=None, artifacts=None))


def restore_backup(source: Path, settings: Settings) -> Backup:
    """Bring everything into an empty place: the data folder, the database and the object store of
    ``settings``. Of an older version, the database has today's schema then.

    Raises BadInput where something is there already, and for what is no backup or damaged; then nothing was
    brought. UnknownSchema, StorageFull, StoreUnavailable.
    """
    data = settings.data
    if data.exists() and any(data.iterdir()):
        raise BadInput(f"the data folder {data} is not empty; name another with GLOVECAL_DATA")
    unfinished = data.with_name(f".{data.name}.{secrets.token_hex(4)}")
    with full_disk_named(data.parent):
        try:
            unfinished.mkdir(mode=PRIVATE_FOLDER, parents=True)
            manifest = _unpack(source, unfinished)
            if settings.database is not None:
                _fill_server(unfinished / SQLITE_FILE, settings)
            if data.exists():
                data.rmdir()
            move_over(unfinished, data)
        except BaseException:
            shutil.rmtree(unfinished, ignore_errors=True)
            raise
    with Store.open(settings) as store:
        if settings.artifacts is not None and settings.artifacts_folder.is_dir():
            for artifact in settings.artifacts_folder.iterdir():
                store.artifacts.put_kept(artifact.name, artifact.read_bytes())
            shutil.rmtree(settings.artifacts_folder)
        with store.database.write() as connection:
            connection.execute(delete(tables.shared_files))  # all lie here now, and are sent from here
        rows, named, problems = _look_through(store)
    return Backup(
        datetime.fromisoformat(manifest["written_at"]), rows, len(named),
        sum(each["name"].startswith(FILES) for each in manifest["files"]), source.stat().st_size, problems,
    )  # fmt: skip


# Writing it.


def _write(store: Store, settings: Settings, file: IO[bytes], folder: Path) -> None:
    written_at, written = datetime.now(UTC), list[dict[str, Any]]()
    with tarfile.open(fileobj=file, mode="w", format=tarfile.PAX_FORMAT) as archive:
        with tempfile.TemporaryDirectory(prefix=".glovecal-backup-", dir=folder) as place:
            copy = Path(place) / DATABASE
            _copy_database(store.database, copy)
            written.append(_add_file(archive, DATABASE, copy))
            with _opened_copy(copy) as of_that_moment:
                named = _artifacts_named(of_that_moment)
        for name in sorted(named):
            kept = store.artifacts.get_kept(name)
            if kept is not None:  # else it is missed when the backup is tried
                written.append(_add(archive, ARTIFACTS + name, len(kept), io.BytesIO(kept)))
        for path in _files(settings):
            try:
                written.append(_add_file(archive, FILES + path.relative_to(settings.data).as_posix(), path))
            except FileNotFoundError:  # retention, or an upload that is over
                continue
        for name, path in store.files.only_elsewhere():
            written.append(_add_file(archive, FILES + name, path))
        manifest = {"format": FORMAT, "written_at": written_at.isoformat(), "files": written}
        content = json.dumps(manifest).encode()
        _add(archive, MANIFEST, len(content), io.BytesIO(content))


def _files(settings: Settings) -> Iterator[Path]:
    """Of the data folder: what is not in the database and not of one run."""
    for path in sorted(settings.data.rglob("*")):
        within = path.relative_to(settings.data).parts
        if within[0] in _OF_ONE_RUN or path.name in _OF_A_PROCESS or path.name.startswith(SQLITE_FILE):
            continue
        if any(part in path.name for part in _UNFINISHED) or path.is_symlink() or not path.is_file():
            continue
        yield path


def _add_file(archive: tarfile.TarFile, name: str, path: Path) -> dict[str, Any]:
    """As long as it is now: a recording that goes on grows meanwhile."""
    with path.open("rb") as file:
        return _add(archive, name, path.stat().st_size, file)


def _add(archive: tarfile.TarFile, name: str, size: int, content: IO[bytes]) -> dict[str, Any]:
    entry = tarfile.TarInfo(name)
    entry.size, entry.mode = size, 0o600
    hashing = _Hashing(content, size)
    archive.addfile(entry, hashing)
    return {"name": name, "bytes": size, "sha256": hashing.digest.hexdigest()}


class _Hashing(io.RawIOBase):
    """So many bytes of a file; a shorter one, as after a cut, ends in zeros."""

    def __init__(self, content: IO[bytes], size: int) -> None:
        self.digest = hashlib.sha256()
        self._content, self._left = content, size

    def read(self, size: int = -1) -> bytes:
        wanted = self._left if size < 0 else min(size, self._left)
        part = self._content.read(wanted).ljust(wanted, b"\0")
        self._left -= wanted
        self.digest.update(part)
        return part


# Databases.


def _copy_database(database: Database, target: Path) -> None:
    if database.file is not None:
        from glovecal_service.store.migrate import backup  # which brings Alembic

        backup(database.file, target)
        return
    with _opened_copy(target) as copy, copy.engine.begin() as to, database.engine.connect() as connection:
        snapshot = connection.execution_options(isolation_level="REPEATABLE READ")
        with snapshot.begin():
            _copy_rows(snapshot, to)


def _fill_server(source: Path, settings: Settings) -> None:
    """Raises BadInput for a database that holds something."""
    upgrade(copy := Database(f"sqlite:///{source}"))
    database = Database(settings.database_url)
    try:
        upgrade(database)
        with copy.engine.begin() as connection, database.engine.begin() as to:
            if to.scalar(select(func.count()).select_from(metadata.tables["audit"])):
                raise BadInput(
                    f"the database {database.name} is not empty; name another with GLOVECAL_DATABASE"
                )
            _copy_rows(connection, to)
            for table in metadata.sorted_tables:
                if (column := table.autoincrement_column) is not None and not database.is_sqlite:
                    to.execute(
                        text(
                            f"SELECT setval(pg_get_serial_sequence('{table.name}', '{column.name}'), "
                            f"coalesce((SELECT max({column.name}) FROM {table.name}), 0) + 1, false)"
                        )
                    )
    finally:
        copy.close()
        database.close()
    source.unlink()
    for file in source.parent.glob(f"{source.name}-*"):
        file.unlink()


def _copy_rows(connection: Connection, to: Connection) -> None:
    """Into a database of the newest schema, in place of what its migrations wrote."""
    for table in reversed(metadata.sorted_tables):
        to.execute(delete(table))
    for table in metadata.sorted_tables:
        rows = connection.execution_options(yield_per=_ROWS_AT_ONCE).execute(select(table))
        for some in rows.partitions(_ROWS_AT_ONCE):
            to.execute(insert(table), [_plain(row._mapping) for row in some])


def _plain(row: Any) -> dict[str, Any]:
    return {
        name: value.document if isinstance(value, JsonText) else value for name, value in dict(row).items()
    }


@contextmanager
def _opened_copy(file: Path) -> Iterator[Database]:
    database = Database(f"sqlite:///{file}")
    try:
        upgrade(database)
        yield database
    finally:
        database.close()


# Reading it.


def _unpack(source: Path, folder: Path) -> dict[str, Any]:
    try:
        with tarfile.open(source, "r:") as archive:
            manifest = _manifest(archive)
            listed = {each["name"]: each for each in manifest["files"]}
            for entry in archive:
                if entry.name != MANIFEST:
                    _unpack_one(archive, entry, listed.pop(entry.name, None), folder)
    except BadInput as error:
        raise BadInput(f"{source} is damaged or no backup of Glovecal: {error}") from error
    except (tarfile.TarError, KeyError, TypeError, ValueError, EOFError) as error:
        raise BadInput(f"{source} is damaged or no backup of Glovecal: its list cannot be read") from error
    if listed:
        raise BadInput(f"{source} is damaged: {len(listed)} files are missing, such as {next(iter(listed))}")
    return manifest


def _manifest(archive: tarfile.TarFile) -> dict[str, Any]:
    entry = archive.getmember(MANIFEST)
    content = archive.extractfile(entry)
    if content is None or entry.size > _LARGEST_MANIFEST:
        raise BadInput("its manifest cannot be read")
    manifest = json.load(content)
    if manifest["format"] != FORMAT:
        raise BadInput(f"its format is {manifest['format']!r}; this version reads {FORMAT!r}")
    return manifest


def _unpack_one(
    archive: tarfile.TarFile, entry: tarfile.TarInfo, listed: dict[str, Any] | None, folder: Path
) -> None:
    content = archive.extractfile(entry) if entry.isreg() else None
    if listed is None or content is None:
        raise BadInput(f"{entry.name!r} is not in its manifest")
    place = _place(folder, entry.name)
    place.parent.mkdir(mode=PRIVATE_FOLDER, parents=True, exist_ok=True)
    digest = hashlib.sha256()
    with open(place, "xb", opener=open_private) as file:
        while part := content.read(1 << 20):
            digest.update(part)
            file.write(part)
    if digest.hexdigest() != listed["sha256"]:
        raise BadInput(f"{entry.name} was changed after it was written")


def _place(folder: Path, name: str) -> Path:
    if name == DATABASE:
        return folder / SQLITE_FILE
    if name.startswith(ARTIFACTS) and SHA256_NAME.match(name.removeprefix(ARTIFACTS)):
        return folder / name
    place = folder / name.removeprefix(FILES)
    if not name.startswith(FILES) or not place.resolve().is_relative_to(folder.resolve()):
        raise BadInput(f"{name!r} does not belong there: a backup restores nothing outside of its folder")
    return place


def _artifacts_named(database: Database) -> set[str]:
    """By models, by takes as they are, and as they were before their reference was replaced."""
    with database.read() as connection:
        named = set(connection.scalars(select(tables.models.c.id)))
        for take in connection.execute(select(tables.takes.c.artifact, tables.takes.c.facts)):
            facts = _plain(take._mapping)["facts"]
            named.update(artifacts_of(take.artifact, facts if isinstance(facts, dict) else {}))
    return {name for name in named if SHA256_NAME.match(name)}


def _look_through(store: Store) -> tuple[dict[str, int], set[str], tuple[str, ...]]:
    """Rows by table, artifacts that are named, and what is wrong."""
    rows, problems = {}, list(store.audit.problems())
    for table in metadata.sorted_tables:
        try:
            with store.database.read() as connection:
                records = sound_rows(connection, table, select(table), lambda values: None)
        except DamagedRows as error:
            problems += error.damaged
            records = error.sound
        rows[table.name] = len(records)
    named = _artifacts_named(store.database)
    for name in sorted(named):
        try:
            store.artifacts.get(name)
        except (NotFound, DamagedArtifact) as error:
            problems.append(str(error))
    return rows, named, tuple(problems)
