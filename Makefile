# On a fresh machine with a Rust toolchain and a C compiler, two commands do everything: `make demo` and `make test`.

PREFIX ?= /usr/local
SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c

help:
	@echo "make demo                  scan the example scenes; clouds and pictures are written to out/demo"
	@echo "make test                  run every test"
	@echo "make check                 run format checks, lints and unit tests only"
	@echo "make build                 release build; the program is target/release/echocast"
	@echo "make python                build the Python package and test it; the wheel is in target/python/tested-wheels"
	@echo "make wheel                 the same, as a wheel for distribution, in target/python/released-wheels"
	@echo "make blender               build the Blender add-on in target/blender and test it in several Blenders"
	@echo "make deb                   build packages for Debian 12 and 13 in target/debs; make test-debs installs them there"
	@echo "make release               build all that is distributed, with checksums, in target/release-files"
	@echo "make test-embrees          test beside other versions of Embree in one process"
	@echo "make test-valgrind         test all functions of the C ABI under Valgrind"
	@echo "make test-crates           test the crates as strangers use them: packaged, by path and by git"
	@echo "make bench                 compare its speed with bare Embree; writes target/bench.json"
	@echo "make install PREFIX=DIR    install program, C library and headers below DIR [$(PREFIX)]"
	@echo "make clean                 remove everything that was built or written"

demo:
	@scripts/setup
	@scripts/demo

test:
	@scripts/setup --test
	@scripts/test

check:
	@scripts/setup
	@scripts/test --fast

build:
	@scripts/setup
	cargo build --release --locked

python:
	@scripts/python

wheel:
	@scripts/python --release

blender:
	@scripts/blender --test

deb:
	@scripts/setup
	@scripts/deb

test-debs: deb
	@scripts/test-debs

test-embrees:
	@scripts/setup --test
	@scripts/test-embrees

test-valgrind:
	@scripts/setup --test
	cargo test --workspace --test programs --locked -- --include-ignored valgrind

test-crates:
	@scripts/setup
	@scripts/test-crates

release:
	@scripts/release

bench:
	@scripts/setup
	cargo build --release --locked
	[ ! -d .embree/lib ] || export ECHOCAST_EMBREE="$${ECHOCAST_EMBREE:-$$PWD/.embree/lib}"; \
	target=$${CARGO_TARGET_DIR:-target}; $$target/release/bench

install: build
	@DESTDIR="$(DESTDIR)" scripts/install "$(PREFIX)"

clean:
	cargo clean
	rm -rf out fuzz/target
	rm -f bindings/python/third-party/Rust-* bindings/python/third-party/Zig.txt

.PHONY: help demo test check build python wheel blender deb test-debs test-embrees test-valgrind test-crates release bench install clean
