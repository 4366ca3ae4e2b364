# The program in an image: docker build -t xavatar:0.1.0 . && docker run --rm -v "$PWD:/work" xavatar:0.1.0 demo --smoke --out demo
FROM rust:1.95-slim-bookworm AS build
RUN apt-get update && apt-get install --yes --no-install-recommends g++ && rm -rf /var/lib/apt/lists/*
WORKDIR /source
COPY . .
RUN cargo build --release --locked --bin xavatar && strip target/release/xavatar

FROM debian:bookworm-slim
COPY --from=build /source/target/release/xavatar /usr/local/bin/xavatar
WORKDIR /work
ENTRYPOINT ["xavatar"]
