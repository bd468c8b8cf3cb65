.PHONY: setup test

# Works on a fresh machine that has Rust.
setup:
	@scripts/setup.sh

test: setup
	cargo test --workspace
