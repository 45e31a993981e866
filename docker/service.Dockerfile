# The Glovecal service: zenoh router, real-time prediction, REST, training workers.
#   docker build -f docker/service.Dockerfile -t glovecal-service .
FROM python:3.11-slim-bookworm AS build
RUN pip install --no-cache-dir uv
WORKDIR /src
COPY pyproject.toml uv.lock ./
COPY models models
COPY client client
COPY service service
ENV UV_PROJECT_ENVIRONMENT=/opt/glovecal UV_LINK_MODE=copy UV_COMPILE_BYTECODE=1
RUN uv sync --frozen --no-default-groups --no-editable --package glovecal-service --extra postgres

FROM python:3.11-slim-bookworm
RUN useradd --create-home --uid 10001 glovecal && install -d -o glovecal /data
COPY --from=build /opt/glovecal /opt/glovecal
ENV PATH=/opt/glovecal/bin:$PATH \
    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 \
    GLOVECAL_DATA=/data GLOVECAL_HOST=0.0.0.0 GLOVECAL_PORT=8600 GLOVECAL_ZENOH=tcp/0.0.0.0:7447
USER glovecal
VOLUME /data
EXPOSE 8600 7447
STOPSIGNAL SIGTERM
HEALTHCHECK --interval=10s --timeout=3s --start-period=30s CMD \
    ["python", "-c", "import urllib.request as r; r.urlopen('http://127.0.0.1:8600/v1/health/ready', timeout=2)"]
CMD ["glovecal", "serve"]
