# The Glovecal service: zenoh router, real-time prediction, REST, studio, cameras, training workers.
#   docker build -f docker/service.Dockerfile -t glovecal-service .
#   docker build -f docker/service.Dockerfile --build-arg EXTRAS="studio postgres" -t glovecal-service .   (without cameras)
#   docker run -v glovecal:/data glovecal-service glovecal site init --host NAME, then glovecal key add NAME --role admin;
#   docker run -v glovecal:/data -e GLOVECAL_SITE_FILE=/data/site/service.glovecal -p 8600:8600 -p 7447:7447 glovecal-service
ARG BASE=python:3.11-slim-bookworm

FROM $BASE AS build
ARG EXTRAS="studio camera postgres"
RUN pip install --no-cache-dir uv
WORKDIR /src
ENV UV_PROJECT_ENVIRONMENT=/opt/glovecal UV_NO_CACHE=1
COPY pyproject.toml uv.lock ./
COPY models/pyproject.toml models/
COPY client/pyproject.toml client/
COPY service/pyproject.toml service/
# Other people's packages as the wheels of uv.lock, by their hashes: nothing is compiled from source. Their tests
# go (60 MB).
RUN uv sync --frozen --no-default-groups --no-install-workspace --no-build \
        --package glovecal-service $(printf -- '--extra %s ' $EXTRAS) && \
    find /opt/glovecal -type d -name tests -prune -exec rm -r {} +
COPY models models
COPY client client
COPY service service
RUN uv sync --frozen --no-default-groups --no-editable --compile-bytecode \
    --package glovecal-service $(printf -- '--extra %s ' $EXTRAS)
# What is in the image, as CycloneDX.
RUN uv export --quiet --frozen --no-default-groups --package glovecal-service $(printf -- '--extra %s ' $EXTRAS) \
        --format cyclonedx1.5 --preview-features sbom-export --output-file /opt/glovecal/sbom.cdx.json

FROM $BASE
RUN useradd --no-create-home --uid 10001 glovecal && install -d -o glovecal -m 700 /data
COPY --from=build /opt/glovecal /opt/glovecal
# HOME: what numba and matplotlib keep for the next start. Beside /data, /tmp is all that has to be writable.
ENV PATH=/opt/glovecal/bin:$PATH HOME=/tmp \
    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 GLOVECAL_INSTALLED_BY=image \
    GLOVECAL_DATA=/data GLOVECAL_HOST=0.0.0.0 GLOVECAL_PORT=8600 GLOVECAL_ZENOH=tls/0.0.0.0:7447
USER 10001
VOLUME /data
EXPOSE 8600 7447
STOPSIGNAL SIGTERM
# Docker images keep this; images in the OCI format have no health check, and compose.yaml and Kubernetes name it.
HEALTHCHECK --interval=10s --timeout=5s --start-period=60s CMD \
    ["python", "-P", "-m", "glovecal_service.health_check"]
CMD ["glovecal", "serve"]
