//! Fills in what URDF files may leave out, but their reader insists on.

/// Stands for an empty geometry: no surface.
const NO_GEOMETRY: &str = r#"<box size="0 0 0"/>"#;
const NO_SPEED: &str = r#" velocity="0""#;
const NO_MASS: &str = r#"<mass value="0"/>"#;
const NO_INERTIA: &str = r#"<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>"#;

/// The same URDF with a placeholder in each empty `<geometry>`, a `velocity` in each `<limit>`, and `<mass>` and
/// `<inertia>` in each `<inertial>`: zero, where the text does not say it.
pub(super) fn completed(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    let mut rest = text;
    // Where the present <inertial> began in `out`.
    let mut inertial = None;
    while let Some(start) = rest.find('<') {
        out.push_str(&rest[..start]);
        rest = &rest[start..];
        let end = if rest.starts_with("<!--") { "-->" } else { ">" };
        let Some(length) = rest.find(end).map(|at| at + end.len()) else {
            break;
        };
        let (tag, after) = rest.split_at(length);
        rest = after;
        let name = |c: char| c.is_whitespace() || c == '/' || c == '>';
        let is_empty = tag.ends_with("/>");
        let (head, tail) = tag.split_at(tag.len() - if is_empty { 2 } else { 1 });
        match tag[1..].split(name).next() {
            Some("geometry") if is_empty => {
                out.extend([head, ">", NO_GEOMETRY, "</geometry>"]);
            }
            Some("geometry") if rest.trim_start().starts_with("</geometry") => {
                out.extend([tag, NO_GEOMETRY]);
            }
            Some("limit") if !has_attribute(tag, "velocity") => out.extend([head, NO_SPEED, tail]),
            Some("inertial") if is_empty => {
                out.extend([head, ">", NO_MASS, NO_INERTIA, "</inertial>"]);
            }
            Some("inertial") => {
                inertial = Some(out.len());
                out.push_str(tag);
            }
            _ => {
                if tag.starts_with("</inertial")
                    && let Some(start) = inertial.take()
                {
                    let inside = out[start..].to_owned();
                    for (element, placeholder) in [("<mass", NO_MASS), ("<inertia", NO_INERTIA)] {
                        let is_element = |part: &str| part.starts_with(name);
                        if !inside.split(element).skip(1).any(is_element) {
                            out.push_str(placeholder);
                        }
                    }
                }
                out.push_str(tag);
            }
        }
    }
    out.push_str(rest);
    out
}

fn has_attribute(tag: &str, name: &str) -> bool {
    let starts = tag.match_indices(name).map(|(at, _)| at);
    starts.into_iter().any(|at| {
        tag[..at].ends_with(char::is_whitespace)
            && tag[at + name.len()..].trim_start().starts_with('=')
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_out_is_filled_in_and_the_rest_stays() {
        for (text, expected) in [
            (
                "<geometry></geometry>",
                r#"<geometry><box size="0 0 0"/></geometry>"#,
            ),
            (
                "<geometry>\n </geometry>",
                "<geometry><box size=\"0 0 0\"/>\n </geometry>",
            ),
            ("<geometry/>", r#"<geometry><box size="0 0 0"/></geometry>"#),
            (
                r#"<limit effort="1"/>"#,
                r#"<limit effort="1" velocity="0"/>"#,
            ),
            (
                r#"<limit lower="0"></limit>"#,
                r#"<limit lower="0" velocity="0"></limit>"#,
            ),
            (
                r#"<inertial><mass value="2"/></inertial>"#,
                r#"<inertial><mass value="2"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>"#,
            ),
        ] {
            assert_eq!(completed(text), expected);
        }
        for whole in [
            r#"<geometry><sphere radius="1"/></geometry>"#,
            r#"<!-- <geometry></geometry> --><limit velocity = "1"/>"#,
            r#"<inertial><mass value="2"/><inertia ixx="1"/></inertial>"#,
            "<robot",
            "a < b > ü",
            "",
        ] {
            assert_eq!(completed(whole), whole);
        }
    }
}
