//! One look a method, the same in all charts.

use super::figure::{Color, Line, Look, Mark};

/// Colours that the colour-blind can tell apart (Okabe and Ito), darker where they are too light for
/// lines.
const BLUE: Color = [0, 114, 178];
const SKY: Color = [66, 160, 213];
const GREEN: Color = [0, 138, 105];
const ORANGE: Color = [210, 140, 0];
pub(super) const RED: Color = [213, 94, 0];
const PURPLE: Color = [184, 91, 147];
pub(super) const BLACK: Color = [0, 0, 0];
const GRAY: Color = [120, 120, 120];

/// Colours of models.
const OF_MODELS: [Color; 6] = [BLUE, RED, GREEN, PURPLE, ORANGE, SKY];

/// What a method's name begins with, and how it looks.
const METHODS: [(&str, Color, Mark); 12] = [
    ("bit grid", ORANGE, Mark::Disc),
    ("grid", BLUE, Mark::Disc),
    ("k-d tree", PURPLE, Mark::Triangle),
    ("bvh rebuild (binned)", GREEN, Mark::Square),
    ("bvh rebuild (ploc)", GREEN, Mark::Ring),
    ("bvh refit", GREEN, Mark::Cross),
    ("voxels", SKY, Mark::Diamond),
    ("compound of balls", GRAY, Mark::Square),
    ("compound of discs", GRAY, Mark::Disc),
    ("mesh rebuild", GRAY, Mark::Triangle),
    ("mesh set_vertices", GRAY, Mark::Cross),
    ("paper", BLACK, Mark::Disc),
];

/// Stages in the order in which they run, and how they look: colours that the colour-blind can tell apart (Tol's muted
/// ones), light and dark ones beside each other.
const STAGES: [(&str, Color); 12] = [
    ("points", [51, 34, 136]),
    ("cull", [136, 204, 238]),
    ("zone", [68, 170, 153]),
    ("aim", [17, 119, 51]),
    ("columns", [153, 153, 51]),
    ("cells", [221, 204, 119]),
    ("windows", [153, 79, 0]),
    ("normals", [238, 153, 170]),
    ("splat", [136, 34, 85]),
    ("sweep", [170, 68, 153]),
    ("compare", [102, 153, 204]),
    ("patches", [85, 85, 85]),
];

/// Of ours.
pub(super) const OURS: Look = Look {
    color: RED,
    mark: Mark::Star,
    line: Line::Thick,
};

/// Of the Pareto front.
pub(super) const FRONT: Look = Look {
    color: [150, 150, 150],
    mark: Mark::None,
    line: Line::Dashed,
};

/// Of a row's method, whatever its form.
pub(super) fn look(method: &str) -> Look {
    if method == "default" || method.starts_with("tldi") {
        return OURS;
    }
    let known = METHODS.iter().find(|(name, ..)| method.starts_with(name));
    let &(_, color, mark) = known.unwrap_or(&("", GRAY, Mark::Ring));
    Look {
        color,
        mark,
        line: Line::Thin,
    }
}

/// Name for a reader who does not know the code.
pub(super) fn title(method: &str) -> String {
    match method {
        "default" => "this project".to_owned(),
        "paper" => "the paper's method, on the CPU".to_owned(),
        _ => match method.strip_prefix("tldi ") {
            Some(backend) => format!("this project {backend}"),
            None => method.to_owned(),
        },
    }
}

/// The place of a stage among those that are known, and its colour. Others, and what is of no stage, come last.
pub(super) fn stage(name: &str) -> (usize, Color) {
    let known = STAGES.iter().position(|(stage, _)| *stage == name);
    known.map_or((STAGES.len(), [221; 3]), |k| (k, STAGES[k].1))
}

/// Of the `index`-th model of a chart.
pub(super) fn model_color(index: usize) -> Color {
    OF_MODELS[index % OF_MODELS.len()]
}

/// Of the `index`-th placement of a chart, of ours alone.
pub(super) fn placement_look(index: usize) -> Look {
    const MARKS: [Mark; 5] = [
        Mark::Cross,
        Mark::Disc,
        Mark::Square,
        Mark::Triangle,
        Mark::Diamond,
    ];
    Look {
        color: OF_MODELS[index % OF_MODELS.len()],
        mark: MARKS[index % MARKS.len()],
        line: Line::Thick,
    }
}

/// Of the `index`-th resolution of the paper's image, beside ours.
pub(super) fn resolution_color(index: usize) -> Color {
    [BLACK, BLUE, SKY, GREEN][index % 4]
}

/// Of ours where the noise is told, beside ours where it is not.
pub(super) fn told_look(color: Color) -> Look {
    Look {
        mark: Mark::Disc,
        ..default_look(color)
    }
}

/// Of the paper's method where both methods have the colour of a model.
pub(super) fn paper_look(color: Color) -> Look {
    Look {
        color,
        mark: Mark::Ring,
        line: Line::Dashed,
    }
}

/// Of ours there.
pub(super) fn default_look(color: Color) -> Look {
    Look {
        color,
        mark: Mark::Star,
        line: Line::Thin,
    }
}
