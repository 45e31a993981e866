# The Glovecal service: zenoh router, real-time prediction, REST, studio, cameras, training workers.
#   docker build -f docker/service.Dockerfile -t glovecal-service .
#   docker build -f docker/service.Dockerfile --build-arg EXTRAS="studio postgres" -t glovecal-service .   (without cameras)
# compose.yaml beside this file runs it; so does (RUN="docker run --hostname glovecal --init --read-only --tmpfs /tmp
# --cap-drop ALL --security-opt no-new-privileges -v glovecal:/data"):
#   $RUN glovecal-service glovecal site init --host NAME, then glovecal key add NAME --role admin;
#   $RUN -e GLOVECAL_SITE_FILE=/data/site/service.glovecal -p 8600:8600 -p 7447:7447 glovecal-service
#
# The base of both images, as https://github.com/docker-library/repo-info recorded it (Python 3.11.16, built on
# 25 August 2026, for x86-64 and ARM). A newer one: docker buildx imagetools inspect python:3.11-slim-bookworm
ARG BASE=python:3.11-slim-bookworm@sha256:0bee7276f83efd4a1ee05bbbf4281d95ed28e079220a9457f25a93e3f1e3c31b

# What is in the image: other people's packages with their hashes, and all of it as CycloneDX.
FROM $BASE AS lock
ARG EXTRAS="studio camera postgres"
RUN pip install --no-cache-dir uv
WORKDIR /src
COPY pyproject.toml uv.lock ./
COPY models/pyproject.toml models/
COPY client/pyproject.toml client/
COPY service/pyproject.toml service/
RUN uv export --quiet --frozen --no-default-groups --no-emit-workspace --no-header --no-annotate \
        --package glovecal-service $(printf -- '--extra %s ' $EXTRAS) --output-file requirements.txt
RUN uv export --quiet --frozen --no-default-groups --package glovecal-service $(printf -- '--extra %s ' $EXTRAS) \
        --format cyclonedx1.5 --preview-features sbom-export --output-file sbom.cdx.json

# Other people's packages, made anew only when their list changes, not with each version of ours. As wheels:
# nothing is compiled from source. Their tests go (60 MB). Our code is beside them, not among them.
FROM $BASE AS packages
RUN pip install --no-cache-dir uv
COPY --from=lock /src/requirements.txt /
RUN uv venv /opt/glovecal && \
    uv pip install --no-cache --python /opt/glovecal --require-hashes --no-build --compile-bytecode \
        -r /requirements.txt && \
    find /opt/glovecal -type d -name tests -prune -exec rm -r {} + && \
    for each in /opt/glovecal/lib/python3*/site-packages; do echo /opt/glovecal/code > $each/glovecal.pth; done

FROM packages AS code
WORKDIR /src
COPY pyproject.toml ./
COPY models models
COPY client client
COPY service service
RUN uv pip install --no-cache --python /opt/glovecal --no-deps --target /opt/glovecal/code --compile-bytecode \
        ./models ./client ./service

FROM $BASE
RUN useradd --no-create-home --uid 10001 glovecal && install -d -o glovecal -m 700 /data
COPY --from=packages /opt/glovecal /opt/glovecal
COPY --from=lock /src/sbom.cdx.json /opt/glovecal/
COPY --from=code /opt/glovecal/code /opt/glovecal/code
# HOME: what numba and matplotlib keep for the next start. Beside /data, /tmp is all that has to be writable.
ENV PATH=/opt/glovecal/code/bin:/opt/glovecal/bin:$PATH HOME=/tmp \
    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 GLOVECAL_INSTALLED_BY=image \
    GLOVECAL_DATA=/data GLOVECAL_HOST=0.0.0.0 GLOVECAL_PORT=8600 GLOVECAL_ZENOH=tls/0.0.0.0:7447
USER 10001
VOLUME /data
EXPOSE 8600 7447 8601
STOPSIGNAL SIGTERM
# Docker images keep this; images in the OCI format have no health check, and compose.yaml and Kubernetes name it.
HEALTHCHECK --interval=10s --timeout=5s --start-period=90s CMD \
    ["python", "-P", "-m", "glovecal_service.health_check"]
CMD ["glovecal", "serve"]
