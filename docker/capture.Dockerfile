# The capture daemon, for the computer the glove is plugged into. Needs the client distribution only.
#   docker build -f docker/capture.Dockerfile -t glovecal-capture .
#   docker run --init --read-only --tmpfs /tmp --cap-drop ALL --security-opt no-new-privileges \
#       --restart unless-stopped --device /dev/ttyUSB0 -v glove-log:/data glovecal-capture \
#       --device cyberglove:/dev/ttyUSB0 --glove right --connect tcp/SERVICE:7447
ARG BASE=python:3.11-slim-bookworm@sha256:0bee7276f83efd4a1ee05bbbf4281d95ed28e079220a9457f25a93e3f1e3c31b

# As in service.Dockerfile, which says where its base is from: what is in the image, then its layers.
FROM $BASE AS lock
RUN pip install --no-cache-dir uv
WORKDIR /src
COPY pyproject.toml uv.lock ./
COPY models/pyproject.toml models/
COPY client/pyproject.toml client/
COPY service/pyproject.toml service/
RUN uv export --quiet --frozen --no-default-groups --no-emit-workspace --no-header --no-annotate \
        --package glovecal-client --extra capture --output-file requirements.txt
RUN uv export --quiet --frozen --no-default-groups --package glovecal-client --extra capture \
        --format cyclonedx1.5 --preview-features sbom-export --output-file sbom.cdx.json

FROM $BASE AS packages
RUN pip install --no-cache-dir uv
COPY --from=lock /src/requirements.txt /
RUN uv venv /opt/glovecal && \
    uv pip install --no-cache --python /opt/glovecal --require-hashes --no-build --compile-bytecode \
        -r /requirements.txt && \
    for each in /opt/glovecal/lib/python3*/site-packages; do echo /opt/glovecal/code > $each/glovecal.pth; done

FROM packages AS code
WORKDIR /src
COPY pyproject.toml ./
COPY client client
RUN uv pip install --no-cache --python /opt/glovecal --no-deps --target /opt/glovecal/code --compile-bytecode ./client

FROM $BASE
RUN useradd --no-create-home --uid 10001 --groups dialout glovecal && install -d -o glovecal -m 700 /data
COPY --from=packages /opt/glovecal /opt/glovecal
COPY --from=lock /src/sbom.cdx.json /opt/glovecal/
COPY --from=code /opt/glovecal/code /opt/glovecal/code
ENV PATH=/opt/glovecal/code/bin:/opt/glovecal/bin:$PATH HOME=/tmp GLOVECAL_INSTALLED_BY=image
USER glovecal
VOLUME /data
STOPSIGNAL SIGTERM
# Docker images keep this; images in the OCI format have no health check.
HEALTHCHECK --interval=30s --timeout=10s --start-period=30s CMD \
    ["python", "-P", "-m", "glovecal_client.capture.health_check", "/data"]
ENTRYPOINT ["glovecal-capture", "--data", "/data"]
CMD ["--help"]
