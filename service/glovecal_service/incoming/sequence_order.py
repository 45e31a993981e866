"""The sequence numbers of one run: they grow, and not faster than a glove can send.

How many frames can lie between two is judged by the frames' own clock: messages that waited, because this
process, its computer or the network stood still, arrive at once.

A number that does not fit is refused. If its publisher means it (it was restarted without a new run id, or
jumped), frames that fit each other follow, and the glove's own frames stay away: then the numbers go on from
there, within a second.
"""

from __future__ import annotations

from dataclasses import dataclass

from glovecal_client.plausible_loss import PlausibleLoss
from glovecal_client.wire.frame import Frame
from glovecal_service.incoming.refusal import Refusal, Refused

CONFIRMED_AFTER_NS = 400_000_000
CONFIRMED_BY_FRAMES = 3
SHARE = 4
"""Where frames still follow the known numbers, the others must be so many times as many."""

_TRACKS = 4
_TRACK_BURST = 50


@dataclass(slots=True, eq=False)
class _Track:
    """Refused frames that fit each other."""

    first: int
    last: int
    since_ns: int
    followed_before: int
    """Frames that had followed the known numbers when it began."""
    loss: PlausibleLoss
    last_ns: int
    frames: int = 1

    def begin_again(self, at_ns: int, followed: int) -> None:
        self.first, self.since_ns, self.frames, self.followed_before = self.last, at_ns, 1, followed


class SequenceOrder:
    """Where one publisher stands. ``at_ns`` is when a message arrived, by this process' monotonic clock.

    ``last`` is the newest number that fitted, -1 before the first. Between two frames it counts what never
    arrived; frames that arrived and could not be read (``unread``) may be those whose numbers are missing.
    """

    def __init__(self) -> None:
        self.last = -1
        self.jumps = 0
        """How often the numbers went on somewhere else."""
        self.jumped_to = 0
        """The first of the numbers taken up last; those up to ``last`` were refused until then."""
        self.tried_ns = 0
        """When a number last fitted others that are not confirmed yet: their publisher is there."""
        self._loss = PlausibleLoss(0)
        self._wall_ns = 0
        """Of the newest frame that fitted: the clock that two runs may share."""
        self._followed = 0
        self._tracks: list[_Track] = []
        self._gap = (0, 0, 0)
        """The newest loss: the frame before it, the frame after it, frames missing."""

    def begin(self, frame: Frame, *, unread: int = 0, whole: bool = False) -> int:
        """Start with the first frame of a run; the number of frames missing before it.

        ``whole``: the run began after the last frame that fitted, so its first frames belong to the account.
        """
        missing = max(0, frame.sequence - unread) if whole else 0
        if not PlausibleLoss(self._wall_ns).allows(missing, frame.wall_ns):
            missing = 0
        self._go_on(frame)
        return missing

    def follow(self, frame: Frame, at_ns: int, *, unread: int = 0) -> int:
        """Take the next frame of the run; the number of frames missing before it.

        The number is negative when earlier losses prove wrong: the numbers had gone on from a made-up one.
        Raises Refused for a number that does not fit (yet).
        """
        lost = frame.sequence - self.last - 1
        if lost >= 0:
            missing = lost - unread if lost > unread else 0
            if self._loss.allows(missing, frame.monotonic_ns):
                if missing:
                    self._gap = self.last, frame.sequence, missing
                self.last, self._wall_ns = frame.sequence, frame.wall_ns
                self._followed += 1
                return missing
        return self._track(frame, at_ns, unread)

    def _track(self, frame: Frame, at_ns: int, unread: int) -> int:
        """Note a number that does not fit. Raises Refused unless those like it are confirmed now."""
        track = self._track_of(frame, at_ns)
        if track.frames >= CONFIRMED_BY_FRAMES and at_ns - track.since_ns >= CONFIRMED_AFTER_NS:
            if (self._followed - track.followed_before) * SHARE <= track.frames:
                return self._take_up(track, frame, unread)
            track.begin_again(at_ns, self._followed)
        raise Refused(*self._reason(frame.sequence))

    def _track_of(self, frame: Frame, at_ns: int) -> _Track:
        """The track that the number continues, or a new one in the place of the weakest."""
        sequence = frame.sequence
        for track in sorted(self._tracks, key=lambda track: track.last, reverse=True):
            if track.last == sequence:
                return track
            if track.last < sequence and track.loss.allows(sequence - track.last - 1, frame.monotonic_ns):
                track.last, track.last_ns, track.frames = sequence, at_ns, track.frames + 1
                if track.frames >= CONFIRMED_BY_FRAMES:
                    self.tried_ns = at_ns
                return track
        if len(self._tracks) >= _TRACKS:
            late_ns = at_ns - CONFIRMED_AFTER_NS
            self._tracks.remove(min(self._tracks, key=lambda track: (track.last_ns > late_ns, track.frames)))
        loss = PlausibleLoss(frame.monotonic_ns, _TRACK_BURST)
        track = _Track(sequence, sequence, at_ns, self._followed, loss, at_ns)
        self._tracks.append(track)
        return track

    def _take_up(self, track: _Track, frame: Frame, unread: int) -> int:
        """``frame`` is the newest of the track."""
        missing = max(0, track.last - track.first + 1 - track.frames - unread)
        before, after, wrong = self._gap
        if before < track.first < after:  # what looked lost was still to come
            missing += track.first - before - 1 - wrong
        self.jumps += 1
        self.jumped_to = track.first
        self._go_on(frame)
        return missing

    def _go_on(self, frame: Frame) -> None:
        self.last, self._wall_ns = frame.sequence, frame.wall_ns
        self._followed += 1
        self._loss = PlausibleLoss(frame.monotonic_ns)
        self._tracks.clear()
        self._gap = (0, 0, 0)

    def _reason(self, sequence: int) -> tuple[Refusal, str]:
        if sequence == self.last:
            return Refusal.DUPLICATE, f"sequence number {sequence} came twice"
        if sequence < self.last:
            return Refusal.SEQUENCE_BACKWARDS, f"sequence number {sequence} came after {self.last}"
        sentence = f"sequence number {sequence} came after {self.last}: no glove sends frames that fast"
        return Refusal.SEQUENCE_JUMP, sentence
