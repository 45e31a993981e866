"""Numbers for Prometheus, in a registry of the application's own."""

from __future__ import annotations

from prometheus_client import CollectorRegistry, Counter, Gauge, Histogram, generate_latest

METHODS = frozenset({"GET", "HEAD", "POST", "PUT", "DELETE", "OPTIONS", "PATCH"})


class Metrics:
    """Counters and histograms; label values come from closed sets, so that no client can grow them."""

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        self.requests = Counter(
            "glovecal_http_requests",
            "Answered requests.",
            ["method", "route", "status"],
            registry=self.registry,
        )
        self.seconds = Histogram(
            "glovecal_http_request_seconds",
            "From the first header to the last byte of the answer.",
            ["route"],
            buckets=(0.001, 0.005, 0.02, 0.1, 0.5, 2.0, 10.0, 60.0),
            registry=self.registry,
        )
        self.uploaded_bytes = Counter(
            "glovecal_uploaded_bytes", "Bytes of uploads that were kept.", registry=self.registry
        )
        self.imported_takes = Counter("glovecal_imported_takes", "Takes imported.", registry=self.registry)
        self.predicted_frames = Counter(
            "glovecal_rest_predicted_frames", "Frames predicted over REST.", registry=self.registry
        )
        self.jobs = Gauge("glovecal_jobs", "Jobs in the database.", ["state"], registry=self.registry)

    def answered(self, method: str, route: str, status: int, seconds: float) -> None:
        known = method if method in METHODS else "other"
        self.requests.labels(known, route, str(status)).inc()
        self.seconds.labels(route).observe(seconds)

    def text(self) -> bytes:
        """All of it in the Prometheus text format."""
        return generate_latest(self.registry)
