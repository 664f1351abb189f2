# Built in one image, run in a small one.
FROM rust:1.95-slim-bookworm AS build
RUN apt-get update && apt-get install -y --no-install-recommends gcc libc6-dev && rm -rf /var/lib/apt/lists/*
WORKDIR /build
COPY Cargo.toml Cargo.lock askama.toml ./
COPY src src
COPY api api
COPY benches benches
RUN cargo build --profile dist --locked --bin skypose

FROM debian:bookworm-slim
# The service needs no ffmpeg, whose libraries are larger than all the rest. To run `grab`, `replay` or `detect` on videos in
# the container: docker build --build-arg EXTRA=ffmpeg .
ARG EXTRA=""
RUN useradd --system --uid 10001 --home-dir /var/lib/skypose --create-home skypose \
 && apt-get update && apt-get install -y --no-install-recommends curl $EXTRA && rm -rf /var/lib/apt/lists/*
COPY --from=build /build/target/dist/skypose /usr/local/bin/skypose
COPY deploy/skypose.toml /etc/skypose/skypose.toml
USER skypose
# Inside a container the door must be open to the outside of it; publish the port only where you trust who comes.
ENV SKYPOSE_CONFIG=/etc/skypose/skypose.toml SKYPOSE_HTTP_LISTEN=0.0.0.0:8080 SKYPOSE_STORE_DATA=/var/lib/skypose
VOLUME /var/lib/skypose
EXPOSE 8080
STOPSIGNAL SIGTERM
HEALTHCHECK --interval=10s --timeout=3s --start-period=5s CMD ["curl", "-fsS", "http://127.0.0.1:8080/readyz"]
ENTRYPOINT ["skypose"]
CMD ["serve"]
