# bottomlock live for companion computers (arm64, x86-64): docker buildx build --platform linux/arm64,linux/amd64 .
FROM rust:1-slim-bookworm AS build
RUN apt-get update && apt-get install --yes --no-install-recommends python3 python3-venv python3-dev && rm -rf /var/lib/apt/lists/*
RUN python3 -m venv /build && /build/bin/pip install --no-cache-dir "maturin>=1.12,<2"
COPY . /source
WORKDIR /source
RUN /build/bin/maturin build --release --locked --out /wheels

FROM python:3.11-slim-bookworm
COPY --from=build /wheels /wheels
RUN pip install --no-cache-dir "$(ls /wheels/*.whl)[live,mavlink]" && rm -rf /wheels
# Logs and checkpoints are written to the mounted folder; serial lines belong to the group dialout.
RUN useradd --create-home --groups dialout vehicle
USER vehicle
WORKDIR /data
EXPOSE 8770
ENTRYPOINT ["bottomlock"]
CMD ["live", "/data/vehicle.toml"]
