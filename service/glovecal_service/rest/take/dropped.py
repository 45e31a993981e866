"""``uploads/{sha256}``: what a file that was sent is, and a memory card's recording as a take table."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Annotated

import anyio.to_thread
from fastapi import APIRouter
from fastapi import Path as InPath

from glovecal_client.capture.cyberglove3.card import CardRecording, card_layout, card_to_table
from glovecal_models.errors import BadInput
from glovecal_service.file_kinds import kind_of
from glovecal_service.request_types import SHA256
from glovecal_service.rest.http.dependencies import PartsNeeded
from glovecal_service.rest.http.problem import change_problems, problems
from glovecal_service.rest.http.temporary_folder import temporary_folder
from glovecal_service.rest.take.answer import CardTable, UploadKind
from glovecal_service.rest.take.uploaded_files import kept_upload

router = APIRouter(prefix="/uploads", tags=["takes"])
UploadInPath = Annotated[str, InPath(pattern=SHA256)]
FRAME_RATE_HZ, MULTIPLIER = 30.0, 3
"""As the glove is delivered; ``glovecal read-card`` has both as options."""


@router.get(
    "/{sha256}/kind",
    response_model=UploadKind,
    summary="What a file that was sent is",
    responses=problems(),
)
def upload_kind(sha256: UploadInPath, parts: PartsNeeded) -> UploadKind:
    """By its content, whatever it is called: a model, another program's calibration, a motion file, a
    recording of a memory card, else a table."""
    return UploadKind(kind=kind_of(kept_upload(parts, sha256)))


@router.post(
    "/{sha256}/card",
    response_model=CardTable,
    summary="A memory card's recording as a take table",
    responses=change_problems(),
)
async def card_table(sha256: UploadInPath, parts: PartsNeeded) -> CardTable:
    """The recording of a CyberGlove III becomes a take table among the uploads; import it with its layout.
    422 for a file without a record."""
    source = await asyncio.to_thread(kept_upload, parts, sha256)
    with temporary_folder() as folder:
        target = Path(folder, "card.csv")
        with parts.uploads.under_names((source.name, source)) as [card]:
            layout, recording = await anyio.to_thread.run_sync(_written, card, target)
        kept = await parts.uploads.receive(_chunks(target))
    seconds = recording.times_s(FRAME_RATE_HZ, MULTIPLIER)[-1]
    return CardTable(
        sha256=kept.sha256, size=kept.size, layout=layout, records=len(recording.records), seconds=seconds,
        damaged=recording.damaged, skipped_bytes=recording.skipped_bytes,
    )  # fmt: skip


def _written(source: Path, target: Path) -> tuple[str, CardRecording]:
    layout = card_layout(source.read_bytes())
    if layout is None:
        raise BadInput("the file holds no record of a CyberGlove III; copy it from the card once more")
    recording = card_to_table(source, target, layout=layout, frame_rate=FRAME_RATE_HZ, multiplier=MULTIPLIER)
    return layout, recording


async def _chunks(path: Path) -> AsyncIterator[bytes]:
    with path.open("rb") as stream:
        while chunk := stream.read(2**20):
            yield chunk
