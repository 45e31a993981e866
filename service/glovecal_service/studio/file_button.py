"""A button that sends a file of the browser's computer."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

from nicegui import events, ui


class FileButton:
    """A button; ``take`` is awaited with each file's name and bytes.

    ``tell`` is called with a sentence when a file is refused by the browser, or does not arrive.
    """

    def __init__(
        self,
        text: str,
        *,
        suffixes: str,
        largest: int,
        take: Callable[[str, bytes], Awaitable[None]],
        tell: Callable[[str], object],
    ) -> None:
        """``suffixes``: such as ``.csv,.parquet``; ``largest``: bytes."""
        self._take = take
        wanted = f"A file here is {suffixes.replace(',', ' or ')}, of at most {largest / 1e6:g} MB."
        # The library's own field has no name for those who hear the page; a button opens it.
        with ui.element("div").classes("capture-upload"):
            self._field = ui.upload(
                on_upload=self._arrived,
                auto_upload=True,
                max_file_size=largest,
                on_rejected=lambda: tell(f"{wanted} Nothing was sent."),
            ).props(f'accept="{suffixes}"')
        self._field.on("failed", lambda: tell("The file did not arrive whole; nothing was kept."), args=[])
        self.button = ui.button(text).on(
            "click", js_handler=f"() => runMethod({self._field.id}, 'pickFiles', [])"
        )

    async def _arrived(self, event: events.UploadEventArguments) -> None:
        self._field.reset()
        await self._take(event.file.name, await event.file.read())
