//! The page.

use super::escape::{html, script_json};
use super::picture::{self, Picture};
use super::scene3d::{Scene3d, packed};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use std::fmt::Write;

const TEMPLATE: &str = include_str!("page.html");
const STYLE: &str = include_str!("style.css");
const VIEWER: &str = include_str!("viewer.js");

/// A figure of the first screen.
#[derive(Clone, Debug)]
pub struct Figure {
    /// What it is, with its unit.
    pub label: String,
    /// Its value.
    pub value: String,
    /// What it means or how it compares, or empty.
    pub note: String,
}

/// A table with a heading.
#[derive(Clone, Debug)]
pub struct Section {
    /// Heading.
    pub title: String,
    /// What to know before reading the table, or empty.
    pub note: String,
    /// Heads of the columns.
    pub head: Vec<String>,
    /// Rows, each as long as the head.
    pub rows: Vec<Vec<String>>,
}

/// A small picture of an image with its keypoints and mask drawn in.
#[derive(Clone, Debug)]
pub struct Thumbnail {
    /// Name of the image.
    pub name: String,
    /// Its figures.
    pub caption: String,
    /// The picture.
    pub jpeg: Vec<u8>,
}

/// Pictures below a heading.
#[derive(Clone, Debug)]
pub struct Gallery {
    /// Heading.
    pub title: String,
    /// What the marks mean, or empty.
    pub note: String,
    /// The pictures.
    pub pictures: Vec<Picture>,
}

/// Everything on the page.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Name of the dive.
    pub title: String,
    /// One sentence: what was done and whether it is good.
    pub verdict: String,
    /// First screen.
    pub figures: Vec<Figure>,
    /// What to worry about.
    pub warnings: Vec<String>,
    /// 3D view.
    pub scene: Scene3d,
    /// Tables.
    pub sections: Vec<Section>,
    /// Drawings, between tables and pictures.
    pub galleries: Vec<Gallery>,
    /// Pictures.
    pub thumbnails: Vec<Thumbnail>,
}

/// The page as HTML; the same report gives the same bytes.
#[must_use]
pub fn render(report: &Report) -> String {
    let mut figures = String::new();
    for figure in &report.figures {
        let _ = write!(
            figures,
            "<div class=\"figure\"><b>{}</b><span>{}</span><small>{}</small></div>",
            html(&figure.value),
            html(&figure.label),
            html(&figure.note)
        );
    }
    let warnings: String = report.warnings.iter().map(|w| format!("<li>{}</li>", html(w))).collect();
    let warnings = if warnings.is_empty() {
        String::new()
    } else {
        format!("<section class=\"warnings\"><h2>Warnings</h2><ul>{warnings}</ul></section>")
    };
    let sections: String = report.sections.iter().map(section).collect();
    let thumbnails: String = report.thumbnails.iter().map(thumbnail).collect();
    let thumbnails = if thumbnails.is_empty() {
        String::new()
    } else {
        format!(
            "<section><h2>Images</h2><p>Keypoints in scene points are green, others orange; background is shaded blue.</p><div class=\"thumbs\">{thumbnails}</div></section>"
        )
    };
    // The parts that hold user text go in last, so that none of it is taken for a placeholder.
    fill(
        TEMPLATE,
        &[
            ("style", STYLE),
            ("viewer", VIEWER),
            ("title", &html(&report.title)),
            ("verdict", &html(&report.verdict)),
            ("figures", &figures),
            ("warnings", &warnings),
            ("sections", &sections),
            ("galleries", &report.galleries.iter().map(gallery).collect::<String>()),
            ("thumbnails", &thumbnails),
            ("scene", &script_json(&packed(&report.scene))),
        ],
    )
}

/// Replaces each `{{name}}` of the template in one pass; what is filled in is not looked at again.
fn fill(template: &str, values: &[(&str, &str)]) -> String {
    let mut out = String::new();
    let mut rest = template;
    while let Some(start) = rest.find("{{") {
        out.push_str(&rest[..start]);
        rest = &rest[start + 2..];
        let Some(end) = rest.find("}}") else { break };
        if let Some((_, value)) = values.iter().find(|(name, _)| *name == &rest[..end]) {
            out.push_str(value);
        }
        rest = &rest[end + 2..];
    }
    out.push_str(rest);
    out
}

fn section(section: &Section) -> String {
    let head: String = section.head.iter().map(|h| format!("<th>{}</th>", html(h))).collect();
    let rows: String = section
        .rows
        .iter()
        .map(|row| format!("<tr>{}</tr>", row.iter().map(|cell| format!("<td>{}</td>", html(cell))).collect::<String>()))
        .collect();
    let note = if section.note.is_empty() { String::new() } else { format!("<p>{}</p>", html(&section.note)) };
    format!(
        "<section><h2>{}</h2>{note}<div class=\"scroll\"><table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div></section>",
        html(&section.title)
    )
}

fn gallery(gallery: &Gallery) -> String {
    let pictures: String = gallery.pictures.iter().map(picture::render).collect();
    let note = if gallery.note.is_empty() { String::new() } else { format!("<p>{}</p>", html(&gallery.note)) };
    format!("<section><h2>{}</h2>{note}<div class=\"thumbs\">{pictures}</div></section>", html(&gallery.title))
}

fn thumbnail(thumbnail: &Thumbnail) -> String {
    format!(
        "<figure><img loading=\"lazy\" alt=\"{0}\" src=\"data:image/jpeg;base64,{1}\"><figcaption>{0}<br><small>{2}</small></figcaption></figure>",
        html(&thumbnail.name),
        STANDARD.encode(&thumbnail.jpeg),
        html(&thumbnail.caption)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn user_text_is_text() {
        let report = Report {
            title: "<script>alert(1)</script> {{viewer}}".into(),
            warnings: vec!["a < b".into()],
            sections: vec![Section {
                title: "T".into(),
                note: String::new(),
                head: vec!["h".into()],
                rows: vec![vec!["{{scene}} & <td>".into()]],
            }],
            ..Report::default()
        };
        let page = render(&report);
        assert!(!page.contains("<script>alert"));
        assert!(page.contains("{{viewer}}"), "text that looks like a placeholder stays text");
        assert!(page.contains("{{scene}} &amp; &lt;td&gt;"));
        assert!(page.contains("a &lt; b"));
    }

    #[test]
    fn the_page_needs_no_network() {
        let page = render(&Report::default());
        assert!(!page.contains("http://") && !page.contains("https://"), "no address in the page");
        assert!(page.starts_with("<!doctype html>"));
    }
}
