# The capture daemon, for the computer the glove is plugged into. Needs the client distribution only.
#   docker build -f docker/capture.Dockerfile -t glovecal-capture .
#   docker run --device /dev/ttyUSB0 -v glove-log:/data glovecal-capture \
#       --device cyberglove:/dev/ttyUSB0 --glove right --connect tcp/SERVICE:7447
ARG BASE=python:3.11-slim-bookworm

FROM $BASE AS build
RUN pip install --no-cache-dir uv
WORKDIR /src
ENV UV_PROJECT_ENVIRONMENT=/opt/glovecal UV_NO_CACHE=1
COPY pyproject.toml uv.lock ./
COPY models/pyproject.toml models/
COPY service/pyproject.toml service/
COPY client client
# Wheels of uv.lock, by their hashes: nobody else's source is compiled.
RUN uv sync --frozen --no-default-groups --no-install-workspace --no-build \
        --package glovecal-client --extra capture && \
    uv sync --frozen --no-default-groups --no-editable --compile-bytecode \
        --package glovecal-client --extra capture
# What is in the image, as CycloneDX.
RUN uv export --quiet --frozen --no-default-groups --package glovecal-client --extra capture \
        --format cyclonedx1.5 --preview-features sbom-export --output-file /opt/glovecal/sbom.cdx.json

FROM $BASE
RUN useradd --no-create-home --uid 10001 --groups dialout glovecal && install -d -o glovecal -m 700 /data
COPY --from=build /opt/glovecal /opt/glovecal
ENV PATH=/opt/glovecal/bin:$PATH HOME=/tmp GLOVECAL_INSTALLED_BY=image
USER glovecal
VOLUME /data
STOPSIGNAL SIGTERM
ENTRYPOINT ["glovecal-capture", "--data", "/data"]
CMD ["--help"]
