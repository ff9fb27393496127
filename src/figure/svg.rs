//! A sheet as SVG: text stays text, so that it can be edited and searched.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use miette::{IntoDiagnostic, Report};
use svg::Document;
use svg::node::Comment;
use svg::node::element::{Group, Image, Polygon, Polyline, Rectangle, Text as Letters, Title};

use super::sheet::{Anchor, Mark, Sheet, Text};
use gdg::draw::hex;
use gdg::text::sanitized;

/// Returns the document.
///
/// # Errors
/// A picture cannot be encoded.
pub fn encode(sheet: &Sheet) -> Result<String, Report> {
    let [width, height] = sheet.size;
    let ground = Rectangle::new().set("width", "100%").set("height", "100%").set("fill", "#fff");
    let mut document = Document::new()
        .set("width", format!("{width}pt"))
        .set("height", format!("{height}pt"))
        .set("viewBox", (0, 0, width, height))
        .set("font-family", "DejaVu Sans, Verdana, sans-serif")
        .set("fill", "none")
        .set("stroke-linejoin", "round")
        .set("stroke-linecap", "round")
        .add(Title::new(sanitized(&sheet.title)))
        .add(Comment::new("gdg-tui"))
        .add(ground);
    for mark in &sheet.marks {
        document = match mark {
            Mark::Line { points, width, colour } => document.add(
                Polyline::new()
                    .set("points", corners(points))
                    .set("stroke", hex(*colour))
                    .set("stroke-width", *width),
            ),
            Mark::Area { points, colour, opacity } => {
                let area = Polygon::new().set("points", corners(points)).set("fill", hex(*colour));
                document.add(if *opacity < 1.0 { area.set("fill-opacity", *opacity) } else { area })
            }
            Mark::Text(text) => document.add(letters(text)),
            Mark::Picture { at, size, picture } => {
                let data = STANDARD.encode(picture.to_png("gdg-tui").into_diagnostic()?);
                document.add(
                    Image::new()
                        .set("x", at[0])
                        .set("y", at[1])
                        .set("width", size[0])
                        .set("height", size[1])
                        .set("href", format!("data:image/png;base64,{data}")),
                )
            }
        };
    }
    Ok(document.to_string() + "\n")
}

fn letters(text: &Text) -> Group {
    let [x, y] = text.at.map(hundredths);
    let anchor = match text.anchor {
        Anchor::Start => "start",
        Anchor::Middle => "middle",
        Anchor::End => "end",
    };
    let turn = if text.turned { " rotate(-90)" } else { "" };
    Group::new().set("transform", format!("translate({x} {y}){turn}")).add(
        Letters::new(sanitized(&text.text))
            .set("font-size", text.size)
            .set("fill", hex(text.colour))
            .set("text-anchor", anchor),
    )
}

fn corners(points: &[[f32; 2]]) -> String {
    let corner = |[x, y]: &[f32; 2]| format!("{},{}", hundredths(*x), hundredths(*y));
    points.iter().map(corner).collect::<Vec<_>>().join(" ")
}

fn hundredths(length: f32) -> f32 {
    (100.0 * length).round() / 100.0
}
