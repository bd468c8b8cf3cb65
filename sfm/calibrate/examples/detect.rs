//! What is found in photographs, one JSON line an image: `cargo run -p calibrate --example detect -- board 9x6 IMAGE...`

use std::error::Error;
use std::path::Path;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let usage = "detect board COLUMNSxROWS IMAGE...";
    let (size, files) = match args.split_first() {
        Some((kind, rest)) if kind == "board" => rest.split_first().ok_or(usage)?,
        _ => return Err(usage.into()),
    };
    let (columns, rows) = size.split_once('x').ok_or(usage)?;
    for file in files {
        let image = imaging::decode_grey(&std::fs::read(file)?)?;
        let found = calibrate::detect_board(&image, columns.parse()?, rows.parse()?);
        let name = Path::new(file).file_name().unwrap_or_default().to_string_lossy();
        match found {
            calibrate::BoardFinding::Found(board) => {
                let corners: Vec<String> = board.corners.iter().map(|p| format!("[{:.4},{:.4}]", p.x, p.y)).collect();
                println!("{{\"image\":\"{name}\",\"corners\":[{}]}}", corners.join(","));
            }
            other => println!("{{\"image\":\"{name}\",\"found\":\"{other:?}\"}}"),
        }
    }
    Ok(())
}
