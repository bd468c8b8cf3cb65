.PHONY: help setup demo test

# The program as `make demo` builds it.
SFM = cargo run --release --quiet --package pipeline --bin sfm --

help:
	@echo "make demo   builds, renders a dive, computes it, and says where to look (again: does what is not done)"
	@echo "make test   runs the whole test suite"
	@echo "make setup  installs what the build needs and the machine lacks; the others do it too"

# Works on a fresh machine that has Rust.
setup:
	@scripts/setup.sh

# demo/dive.toml is the last file that `sfm synth` writes; it refuses a folder that is not its own.
demo: setup
	cargo build --release --package pipeline
	@[ -f demo/dive.toml ] || $(SFM) synth demo
	@$(SFM) run demo/dive.toml

test: setup
	cargo test --workspace
