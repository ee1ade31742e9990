//! Fills in what URDF files may leave out, but their reader insists on.

use roxmltree::{Document, Node};
use std::ops::Range;

/// Stands for an empty geometry: no surface.
const NO_GEOMETRY: &str = r#"<box size="0 0 0"/>"#;
const NO_SPEED: &str = r#" velocity="0""#;
const NO_MASS: &str = r#"<mass value="0"/>"#;
const NO_INERTIA: &str = r#"<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>"#;

/// The text of a URDF with a placeholder in each empty `<geometry>`, a `velocity` in each `<limit>`, and `<mass>` and
/// `<inertia>` in each `<inertial>`: zero, where the text does not say it.
pub(super) fn completed(document: &Document<'_>) -> String {
    let text = document.input_text();
    let mut edits: Vec<(Range<usize>, String)> = Vec::new();
    for node in document.descendants().filter(Node::is_element) {
        let has = |name: &str| node.children().any(|part| part.tag_name().name() == name);
        match node.tag_name().name() {
            "geometry" if !node.children().any(|part| part.is_element()) => {
                edits.push(inside(text, node, NO_GEOMETRY));
            }
            "limit" if !node.has_attribute("velocity") => {
                let name_end = node.range().start + 1 + name_of(text, node).len();
                edits.push((name_end..name_end, NO_SPEED.to_owned()));
            }
            "inertial" => {
                let parts = [("mass", NO_MASS), ("inertia", NO_INERTIA)];
                let missing = parts.into_iter().filter(|(name, _)| !has(name));
                let missing: String = missing.map(|(_, placeholder)| placeholder).collect();
                edits.push(inside(text, node, &missing));
            }
            _ => {}
        }
    }
    // From the end: what is before an edit stays where it is.
    edits.sort_by_key(|(range, _)| range.start);
    let mut out = text.to_owned();
    for (range, replacement) in edits.into_iter().rev() {
        out.replace_range(range, &replacement);
    }
    out
}

/// What to write where, so that an element has `more` at its end.
fn inside(text: &str, node: Node<'_, '_>, more: &str) -> (Range<usize>, String) {
    let all = node.range();
    match text[all.clone()].rfind("</") {
        Some(end) => (all.start + end..all.start + end, more.to_owned()),
        None => {
            let name = name_of(text, node);
            (all.end - "/>".len()..all.end, format!(">{more}</{name}>"))
        }
    }
}

/// The name of an element as it is written, with its prefix.
fn name_of<'a>(text: &'a str, node: Node<'_, '_>) -> &'a str {
    let tag = &text[node.range()][1..];
    let is_past_name = |c: char| c.is_whitespace() || c == '/' || c == '>';
    tag.split(is_past_name).next().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_out_is_filled_in_and_the_rest_stays() {
        let zero = r#"<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>"#;
        let no_box = r#"<box size="0 0 0"/>"#;
        for (text, expected) in [
            (
                "<geometry></geometry>",
                format!("<geometry>{no_box}</geometry>"),
            ),
            (
                "<geometry>\n </geometry>",
                format!("<geometry>\n {no_box}</geometry>"),
            ),
            ("<geometry/>", format!("<geometry>{no_box}</geometry>")),
            (
                r#"<limit effort="1"/>"#,
                r#"<limit velocity="0" effort="1"/>"#.to_owned(),
            ),
            (
                r#"<limit lower="0"></limit>"#,
                r#"<limit velocity="0" lower="0"></limit>"#.to_owned(),
            ),
            (
                "<inertial/><limit/>",
                format!(r#"<inertial><mass value="0"/>{zero}</inertial><limit velocity="0"/>"#),
            ),
            (
                r#"<inertial><mass value="2"/></inertial>"#,
                format!(r#"<inertial><mass value="2"/>{zero}</inertial>"#),
            ),
        ] {
            assert_completed(text, &expected);
        }
        for whole in [
            r#"<geometry><sphere radius="1"/></geometry>"#,
            r#"<!-- <geometry></geometry> --><limit velocity = "1"/>"#,
            r#"<inertial><mass value="2"/><inertia ixx="1"/></inertial>"#,
            "a &lt; b &gt; ü",
        ] {
            assert_completed(whole, whole);
        }
    }

    fn assert_completed(text: &str, expected: &str) {
        let [text, expected] = [text, expected].map(|inner| format!("<robot>{inner}</robot>"));
        assert_eq!(completed(&Document::parse(&text).unwrap()), expected);
    }
}
