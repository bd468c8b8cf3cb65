//! Drawings on the page, as SVG.

use super::escape::html;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use std::fmt::Write;

/// What is drawn, in pixels of the picture. Colours are those of CSS.
#[derive(Clone, Debug, PartialEq)]
pub enum Mark {
    /// A line through points.
    Line {
        /// The points.
        points: Vec<[f64; 2]>,
        /// Its colour.
        colour: &'static str,
        /// Its width.
        width: f64,
    },
    /// A disc.
    Dot {
        /// Its centre.
        at: [f64; 2],
        /// Its radius.
        radius: f64,
        /// Its colour.
        colour: &'static str,
    },
}

/// A drawing, over a photograph or on white.
#[derive(Clone, Debug)]
pub struct Picture {
    /// Its name.
    pub name: String,
    /// What it shows.
    pub caption: String,
    /// Width and height in which marks are given.
    pub size: [f64; 2],
    /// The photograph, stretched to that size.
    pub jpeg: Option<Vec<u8>>,
    /// The marks, the lowest first.
    pub marks: Vec<Mark>,
}

pub(super) fn render(picture: &Picture) -> String {
    let [w, h] = picture.size;
    let mut svg = format!("<svg viewBox=\"0 0 {w} {h}\" role=\"img\" aria-label=\"{}\">", html(&picture.name));
    if let Some(jpeg) = &picture.jpeg {
        let data = STANDARD.encode(jpeg);
        let _ = write!(svg, "<image width=\"{w}\" height=\"{h}\" preserveAspectRatio=\"none\" href=\"data:image/jpeg;base64,{data}\"/>");
    }
    for mark in &picture.marks {
        match mark {
            Mark::Line { points, colour, width } => {
                let _ = write!(svg, "<polyline fill=\"none\" stroke=\"{colour}\" stroke-width=\"{width:.2}\" points=\"");
                for p in points {
                    let _ = write!(svg, "{:.2},{:.2} ", p[0], p[1]);
                }
                svg.push_str("\"/>");
            }
            Mark::Dot { at, radius, colour } => {
                let _ = write!(svg, "<circle cx=\"{:.2}\" cy=\"{:.2}\" r=\"{radius:.2}\" fill=\"{colour}\"/>", at[0], at[1]);
            }
        }
    }
    let (name, caption) = (html(&picture.name), html(&picture.caption));
    format!("<figure>{svg}</svg><figcaption>{name}<br><small>{caption}</small></figcaption></figure>")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_drawn_and_names_are_text() {
        let line = Mark::Line { points: vec![[1.0, 2.0], [3.0, 4.5]], colour: "red", width: 1.0 };
        let dot = Mark::Dot { at: [5.0, 6.0], radius: 2.0, colour: "green" };
        let (name, caption) = ("<C1>".to_owned(), "a & b".to_owned());
        let out = render(&Picture { name, caption, size: [10.0, 8.0], jpeg: Some(vec![1, 2, 3]), marks: vec![line, dot] });
        assert!(out.contains("points=\"1.00,2.00 3.00,4.50 \"") && out.contains("<circle cx=\"5.00\""), "{out}");
        assert!(out.contains("&lt;C1&gt;") && out.contains("a &amp; b") && !out.contains("<C1>"));
        assert!(out.contains("data:image/jpeg;base64,AQID"));
    }
}
