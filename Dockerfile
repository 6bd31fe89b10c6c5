# The demo in a container:
#   docker build -t why-blurry .
#   docker run --rm -v "$PWD/results:/home/user/why-blurry/results" why-blurry
# Your photos:
#   docker run --rm -v "$PWD/results:/home/user/why-blurry/results" \
#     -v "$PWD/my_photos:/home/user/why-blurry/my_photos:ro" \
#     why-blurry make photos FOLDER=my_photos
# Files in results/ belong to user 1000; for another: --build-arg USER_ID="$(id -u)".
FROM python:3.11-slim-bookworm

# The compiler makes the kernels when a training starts, for the processor it runs on.
RUN apt-get update \
    && apt-get install -y --no-install-recommends g++ make \
    && rm -rf /var/lib/apt/lists/*

ARG USER_ID=1000
RUN useradd --create-home --uid "$USER_ID" user
USER user
RUN mkdir /home/user/why-blurry
WORKDIR /home/user/why-blurry

# Packages come before the sources: a change of these installs nothing anew.
COPY --chown=user Makefile requirements.lock ./
RUN make .venv/.installed && rm -rf /home/user/.cache/pip

COPY --chown=user . .
# A checkout may be younger than the packages of the same lock.
RUN touch .venv/.installed

VOLUME /home/user/why-blurry/results
CMD ["make", "run"]
