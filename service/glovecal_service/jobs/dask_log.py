"""What Dask writes to logs: nothing. A job that fails says why in its row; whether workers are there, we ask.

Its ``silence_logs`` is not enough: that changes Dask's own handlers, of which there are none in a program
that has made some, and takes the change back when a cluster closes, which is when connections break and are
logged with tracebacks. A task that ends just after its client was closed is "critical" to the scheduler
(CommClosedError in ``send_all``): that is how a service stops whose workers are busy. The import of Dask sets
levels anew, so this is called after it.
"""

from __future__ import annotations

import logging


def silence_dask() -> None:
    """For as long as this process lives."""
    for name in ("distributed", "distributed.client", "distributed.gc", "tornado", "tornado.application"):
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    logging.getLogger("asyncio").addFilter(_is_not_of_dask)


def _is_not_of_dask(record: logging.LogRecord) -> bool:
    """Tasks that nobody awaits any more are shown with the file that defines them."""
    return "distributed" not in record.getMessage()
