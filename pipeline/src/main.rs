//! The `sfm` program.

fn main() -> std::process::ExitCode {
    pipeline::cli::main()
}
