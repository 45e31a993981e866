# The capture daemon, for the computer the glove is plugged into. Needs the client distribution only.
#   docker build -f docker/capture.Dockerfile -t glovecal-capture .
#   docker run --device /dev/ttyUSB0 -v glove-log:/data glovecal-capture \
#       --device cyberglove:/dev/ttyUSB0 --glove right --connect tcp/SERVICE:7447
FROM python:3.11-slim-bookworm AS build
RUN pip install --no-cache-dir uv
WORKDIR /src
COPY pyproject.toml uv.lock ./
COPY models/pyproject.toml models/
COPY service/pyproject.toml service/
COPY client client
ENV UV_PROJECT_ENVIRONMENT=/opt/glovecal UV_LINK_MODE=copy UV_COMPILE_BYTECODE=1
RUN uv sync --frozen --no-default-groups --no-editable --package glovecal-client --extra capture

FROM python:3.11-slim-bookworm
RUN useradd --create-home --uid 10001 --groups dialout glovecal && install -d -o glovecal /data
COPY --from=build /opt/glovecal /opt/glovecal
ENV PATH=/opt/glovecal/bin:$PATH
USER glovecal
VOLUME /data
STOPSIGNAL SIGTERM
ENTRYPOINT ["glovecal-capture", "--data", "/data"]
CMD ["--help"]
