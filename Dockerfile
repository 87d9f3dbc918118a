# Builds both programs and a small image for nodes and the command line.
FROM rust:1.95-bookworm AS build
RUN apt-get update \
    && apt-get install -y --no-install-recommends g++ \
    && rm -rf /var/lib/apt/lists/*
WORKDIR /src
COPY . .
# For `--version`; without them, git tells of the repository that came along.
ARG BRICKCAST_COMMIT=
ARG SOURCE_DATE_EPOCH=
RUN cargo build --release --locked --bins -p brickcast -p brickcast-node

FROM debian:bookworm-slim
# The Vulkan loader and a software driver; hosts with NVIDIA GPUs add theirs through the container toolkit, which needs the X11
# and EGL libraries.
RUN apt-get update \
    && apt-get install -y --no-install-recommends ca-certificates libegl1 libvulkan1 libxext6 mesa-vulkan-drivers \
    && rm -rf /var/lib/apt/lists/* \
    && groupadd --gid 10001 brickcast \
    && useradd --uid 10001 --gid 10001 --no-create-home --home-dir /nonexistent --shell /usr/sbin/nologin brickcast \
    # Named volumes take over owner and mode: everyone of the group may add stores.
    && install -d -o 10001 -g 10001 -m 2775 /data /tls /out
COPY --from=build /src/target/release/brickcast /src/target/release/brickcast-node /usr/local/bin/
USER 10001:10001
EXPOSE 7000
CMD ["brickcast", "--help"]
