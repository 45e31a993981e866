"""The store: everything that outlives a process, one attribute per noun."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from types import TracebackType

from glovecal_client.encryption.key_file import KEY_ID_FILE, settle_encryption
from glovecal_client.private_files import PRIVATE_FOLDER, make_private
from glovecal_service.settings import Settings
from glovecal_service.store.actor import NOBODY_ELSE, Actor
from glovecal_service.store.audit import Audit
from glovecal_service.store.blobs import Artifacts, FolderBlobs, full_disk_named
from glovecal_service.store.changes import Changes, changes_since
from glovecal_service.store.damages import Damages
from glovecal_service.store.data_folder_lock import LOCK, WHO
from glovecal_service.store.database import Database
from glovecal_service.store.gloves import Gloves
from glovecal_service.store.jobs import Jobs
from glovecal_service.store.keys import Keys
from glovecal_service.store.layouts import Layouts
from glovecal_service.store.models import Models
from glovecal_service.store.object_blobs import ObjectBlobs
from glovecal_service.store.people import People
from glovecal_service.store.recordings import Recordings
from glovecal_service.store.samplings import Samplings
from glovecal_service.store.schema import upgrade
from glovecal_service.store.sessions import Sessions
from glovecal_service.store.shared_files import SharedFiles
from glovecal_service.store.subjects import Subjects
from glovecal_service.store.takes import Takes


class Store:
    """Safe to use from several threads; several processes may open the same one."""

    def __init__(
        self, database: Database, artifacts: Artifacts, files: SharedFiles, clock: Callable[[], float]
    ) -> None:
        self.database = database
        self.artifacts = artifacts
        self.files = files
        self.actor = NOBODY_ELSE
        """Who asks."""
        self._clock = clock
        self.subjects = Subjects(database)
        self.layouts = Layouts(database)
        self.gloves = Gloves(database)
        self.takes = Takes(database, artifacts)
        self.models = Models(database, artifacts)
        self.damages = Damages(database, artifacts, self.models)
        self.recordings = Recordings(database)
        self.samplings = Samplings(database)
        self.jobs = Jobs(database, clock)
        self.keys = Keys(database)
        self.people = People(database)
        self.sessions = Sessions(database)
        self.audit = Audit(database)

    @classmethod
    def open(cls, settings: Settings, *, clock: Callable[[], float] = time.time) -> Store:
        """Create the folders, upgrade the schema, sweep what killed processes left.

        ``clock`` gives seconds since 1970 and is what leases run on. Raises StorageFull, StoreUnavailable,
        StoreDamaged, NewerSchema, BadInput (settings), BadEncryptionKey.
        """
        with full_disk_named(settings.data):
            settings.data.mkdir(mode=PRIVATE_FOLDER, parents=True, exist_ok=True)
        settle_encryption(settings.data)
        with full_disk_named(settings.data):
            for folder in (settings.uploads_folder, settings.recordings_folder, settings.fits_folder):
                folder.mkdir(mode=PRIVATE_FOLDER, parents=True, exist_ok=True)
        database = Database(settings.database_url)
        close_to_others(settings.data.resolve(), database.files)
        objects = (
            ObjectBlobs(settings.artifacts, settings.data / "artifacts-cache") if settings.artifacts else None
        )
        artifacts = Artifacts(objects or FolderBlobs(settings.artifacts_folder))
        try:
            upgrade(database)
            for file in database.files:
                make_private(file)
        except BaseException:
            database.close()
            raise
        return cls(database, artifacts, SharedFiles(database, objects, settings.data), clock)

    def changes_since(self, seen: int | None) -> Changes:
        """As ``glovecal_service.store.changes`` has it."""
        return changes_since(self.database, seen)

    def acting_as(self, actor: Actor) -> Store:
        """The same store, asked by somebody: what they do not see is not there, and changes are theirs."""
        database = self.database.acting_as(actor)
        bound = Store(database, self.artifacts, self.files.acting_as(database), self._clock)
        bound.actor = actor
        return bound

    def close(self) -> None:
        """Give the connections back; the store can still be used afterwards and opens new ones."""
        self.database.close()

    def __enter__(self) -> Store:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


# A data folder that other users of the computer could look into is closed to them when it is opened.


FOLDERS = frozenset(
    {
        "artifacts",
        "artifacts-cache",
        "cameras",
        "capture",
        "films",
        "fits",
        "owners",
        "pulses",
        "recordings",
        "uploads",
        "videos",
    }
)
_log = logging.getLogger("glovecal.store")


def close_to_others(data: Path, database_files: Sequence[Path]) -> None:
    """Files 600, folders 700; the log says so where they were not.

    ``data`` itself, resolved, is closed if there is nothing in it but ours: it may be a folder, such as a
    home, that others have to pass. What another user owns stays as it is, with a warning.
    """
    entries = list(data.iterdir())
    ours = [
        entry
        for entry in entries
        if entry.name in (*FOLDERS, LOCK, WHO, KEY_ID_FILE) or entry in database_files
    ]
    places = [data] if len(ours) == len(entries) else ours
    closed = 0
    for place in (*places, *database_files):
        try:
            closed += make_private(place)
        except PermissionError as error:
            _log.warning("other users may read %s: its permissions cannot be changed (%s)", place, error)
    if closed:
        _log.warning("other users could read %d files and folders of %s; that is over", closed, data)
