//! Where the parts of a COLLADA file belong.
//!
//! The loader of meshes reads the geometries. Of the scene it keeps one place for each, multiplies matrices from the
//! wrong side, and takes a part that is within a centimetre of its parent for one that is not moved. So it gets the file without its
//! scene.

use crate::mesh::Mesh;
use roxmltree::{Document, Node};
use std::collections::HashMap;
use tldi::glamx::{DAffine3, DMat4, DQuat, DVec3, Pose3};

/// The mesh of all nodes of the scene, in metres. `load` gives the geometries of a file, by their ids, in its unit. The axis that
/// the file calls up stays what it is, as in ROS.
///
/// # Errors
/// What is wrong, for people.
pub(crate) fn placed(
    bytes: &[u8],
    load: impl FnOnce(&[u8]) -> Result<Vec<(String, Mesh)>, String>,
) -> Result<Mesh, String> {
    let text = std::str::from_utf8(bytes).map_err(|_| unusable("its text is not UTF-8"))?;
    let document = Document::parse(text).map_err(|error| error.to_string())?;
    let root = document.root_element();
    let geometries = load(without_scene(text, root).as_bytes())?;
    let root_frame = DMat4::from_scale(DVec3::splat(unit(root)));
    let mut mesh = Mesh::default();
    let Some(shown) = shown(&document, root_frame)? else {
        // Without a scene, all that is there counts.
        for (_, geometry) in &geometries {
            append(&mut mesh, geometry, root_frame);
        }
        return Ok(mesh);
    };
    let geometries: HashMap<String, Mesh> = geometries.into_iter().collect();
    for (id, frame) in shown {
        if let Some(geometry) = geometries.get(id) {
            append(&mut mesh, geometry, frame);
        }
    }
    Ok(mesh)
}

fn unusable(what: &str) -> String {
    format!("{what}: save it as STL, OBJ or PLY")
}

/// The text of the file without the elements that place geometries.
fn without_scene(text: &str, root: Node<'_, '_>) -> String {
    let mut kept = String::with_capacity(text.len());
    let mut end = 0;
    for part in elements(root) {
        if ["scene", "library_visual_scenes"].contains(&part.tag_name().name()) {
            kept.push_str(&text[end..part.range().start]);
            end = part.range().end;
        }
    }
    kept + &text[end..]
}

/// Metres in the unit of the file.
fn unit(root: Node<'_, '_>) -> f64 {
    let unit = child(root, "asset").and_then(|asset| child(asset, "unit"));
    let metres = unit.and_then(|unit| number(unit.attribute("meter")?));
    metres.filter(|metres| *metres > 0.0).unwrap_or(1.0)
}

/// The id of a geometry in the scene, and the frame of the node that shows it.
type Shown<'a> = (&'a str, DMat4);

/// The geometries in the scene, as often as they are there; none without a scene.
fn shown<'a>(document: &'a Document<'_>, root: DMat4) -> Result<Option<Vec<Shown<'a>>>, String> {
    let named = document
        .descendants()
        .filter_map(|n| Some((n.attribute("id")?, n)));
    let named: HashMap<&str, Node<'_, '_>> = named.collect();
    let target = |instance: Node<'a, '_>| instance.attribute("url")?.strip_prefix('#');
    let scene = child(document.root_element(), "scene")
        .and_then(|scene| child(scene, "instance_visual_scene"))
        .and_then(|instance| named.get(target(instance)?).copied());
    let Some(scene) = scene else {
        return Ok(None);
    };
    let mut shown = Vec::new();
    // Nodes to visit, their frames, and how many nodes elsewhere lead to them.
    let mut open = vec![(scene, Some(root), 0)];
    while let Some((node, frame, depth)) = open.pop() {
        if depth > named.len() {
            return Err(unusable("its nodes hold each other in a circle"));
        }
        let inside = |node: Node<'_, '_>| Some(frame? * transform(node)?);
        for part in elements(node) {
            match part.tag_name().name() {
                "node" => open.push((part, inside(part), depth)),
                "instance_node" => {
                    let node = target(part).and_then(|id| named.get(id).copied());
                    open.extend(node.map(|node| (node, inside(node), depth + 1)));
                }
                "instance_geometry" | "instance_controller" => {
                    let frame = frame.ok_or_else(|| {
                        unusable("a part is placed by `skew`, `lookat` or what is no number")
                    })?;
                    // A controller has a skin over a geometry.
                    let skin = target(part)
                        .and_then(|id| child(*named.get(id)?, "skin"))
                        .and_then(|skin| skin.attribute("source")?.strip_prefix('#'));
                    shown.extend(skin.or_else(|| target(part)).map(|id| (id, frame)));
                }
                _ => {}
            }
        }
    }
    Ok(Some(shown))
}

/// From the frame of a node into that of its parent; none if it is not known.
fn transform(node: Node<'_, '_>) -> Option<DMat4> {
    let mut parent_from_node = DMat4::IDENTITY;
    for part in elements(node) {
        let numbers = || -> Option<Vec<f64>> {
            let words = part.text().unwrap_or_default().split_whitespace();
            words.map(number).collect()
        };
        parent_from_node *= match part.tag_name().name() {
            "matrix" => DMat4::from_cols_array(&numbers()?.try_into().ok()?).transpose(),
            "translate" => DMat4::from_translation(DVec3::from_array(numbers()?.try_into().ok()?)),
            "scale" => DMat4::from_scale(DVec3::from_array(numbers()?.try_into().ok()?)),
            "rotate" => {
                let [x, y, z, degrees] = numbers()?.try_into().ok()?;
                let axis = DVec3::new(x, y, z).normalize_or(DVec3::X);
                DMat4::from_quat(DQuat::from_axis_angle(axis, degrees.to_radians()))
            }
            "skew" | "lookat" => return None,
            _ => continue,
        };
    }
    Some(parent_from_node)
}

fn append(mesh: &mut Mesh, geometry: &Mesh, frame: DMat4) {
    let placed = geometry.clone().transformed(DAffine3::from_mat4(frame));
    mesh.append(&placed, &Pose3::IDENTITY);
}

fn elements<'a, 'i>(node: Node<'a, 'i>) -> impl Iterator<Item = Node<'a, 'i>> {
    node.children().filter(Node::is_element)
}

fn child<'a, 'i>(node: Node<'a, 'i>, name: &str) -> Option<Node<'a, 'i>> {
    elements(node).find(|part| part.tag_name().name() == name)
}

/// A finite number; some exporters write the decimal mark of their country.
fn number(text: &str) -> Option<f64> {
    let number: f64 = text.trim().replace(',', ".").parse().ok()?;
    number.is_finite().then_some(number)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tldi::glamx::Vec3;

    /// A triangle with its right angle at the origin, as the geometry `g`.
    fn triangle() -> Vec<(String, Mesh)> {
        let mesh = Mesh {
            points: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            faces: vec![[0, 1, 2]],
        };
        vec![("g".to_owned(), mesh)]
    }

    /// A file whose scene has these nodes, and the first corners of its triangles.
    fn corners(unit: &str, nodes: &str) -> Result<Vec<Vec3>, String> {
        let text = format!(
            r##"<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset>{unit}<up_axis>Y_UP</up_axis></asset><library_geometries><geometry id="g"/></library_geometries>
<library_nodes><node id="wheel"><translate>0 0 2</translate><instance_geometry url="#g"/></node></library_nodes>
<library_visual_scenes><visual_scene id="s">{nodes}</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"##
        );
        let mesh = placed(text.as_bytes(), |bytes| {
            let text = String::from_utf8_lossy(bytes);
            assert!(
                text.contains("geometry") && !text.contains("scene"),
                "{text}"
            );
            assert!(text.ends_with("</COLLADA>"), "{text}");
            Ok(triangle())
        })?;
        Ok(mesh.first_corners())
    }

    const SHOWN: &str = r##"<instance_geometry url="#g"/>"##;

    #[test]
    fn parts_are_where_their_nodes_place_them() {
        let matrix = "<matrix>0 -1 0 5 1 0 0 6 0 0 1 7 0 0 0 1</matrix>";
        let turned = "<translate>1 0 0</translate><rotate>0 0 1 90</rotate>";
        for (unit, nodes, expected) in [
            (
                "",
                format!("<node>{matrix}{SHOWN}</node>"),
                Vec3::new(5.0, 6.0, 7.0),
            ),
            // A few millimetres, too.
            (
                "",
                format!("<node><translate>.004 0 0</translate>{SHOWN}</node>"),
                Vec3::X * 0.004,
            ),
            // The unit is that of the nodes as well.
            (
                r#"<unit meter="0.01"/>"#,
                format!("<node>{matrix}{SHOWN}</node>"),
                Vec3::new(0.05, 0.06, 0.07),
            ),
            (
                r#"<unit meter="0,5"/>"#,
                format!("<node>{turned}{SHOWN}</node>"),
                Vec3::X * 0.5,
            ),
            // Turned first, then 2 along what is y now, and down by 1.
            (
                "",
                format!("<node>{turned}<node><translate>2 0 -1</translate>{SHOWN}</node></node>"),
                Vec3::new(1.0, 2.0, -1.0),
            ),
            (
                "",
                format!(r##"<node>{turned}<instance_node url="#wheel"/></node>"##),
                Vec3::new(1.0, 0.0, 2.0),
            ),
        ] {
            let found = corners(unit, &nodes).unwrap();
            assert_eq!(found.len(), 1, "{nodes}");
            assert!(found[0].distance(expected) < 1e-6, "{nodes}: {found:?}");
        }
    }

    #[test]
    fn a_part_is_there_as_often_as_it_is_shown() {
        let at = |x| format!("<node><translate>{x} 0 0</translate>{SHOWN}</node>");
        let found = corners("", &(at(3) + &at(-3) + &at(8))).unwrap();
        assert_eq!(found, [-3.0, 3.0, 8.0].map(|x| x * Vec3::X));
        assert!(corners("", "<node/>").unwrap().is_empty());
        let bare = placed(b"<COLLADA/>", |_| Ok(triangle())).unwrap();
        assert_eq!(bare.faces.len(), 1);
    }

    #[test]
    fn a_mirrored_part_keeps_its_outside() {
        let text = format!(
            r##"<COLLADA><library_visual_scenes><visual_scene id="s"><node><scale>-1 1 1</scale>{SHOWN}</node></visual_scene>
</library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"##
        );
        let mesh = placed(text.as_bytes(), |_| Ok(triangle())).unwrap();
        let [a, b, c] = mesh.faces[0].map(|i| mesh.points[i as usize]);
        assert!((b - a).cross(c - a).z > 0.0, "{a} {b} {c}");
    }

    #[test]
    fn what_cannot_be_placed_is_refused() {
        for nodes in [
            format!("<node><skew>1 0 0 0 1 0 0</skew><node>{SHOWN}</node></node>"),
            format!("<node><translate>1 0</translate>{SHOWN}</node>"),
            format!("<node><translate>1 0 nan</translate>{SHOWN}</node>"),
            r##"<node id="a"><instance_node url="#a"/></node>"##.to_owned(),
        ] {
            let error = corners("", &nodes).unwrap_err();
            assert!(error.contains("save it as"), "{nodes}: {error}");
        }
        // A camera has no surface.
        let camera = format!("<node><lookat>0 0 9 0 0 0 0 1 0</lookat></node><node>{SHOWN}</node>");
        assert_eq!(corners("", &camera).unwrap(), [Vec3::ZERO]);
    }
}
