//! What a chart shows, before it is drawn.

/// Red, green, blue.
pub(super) type Color = [u8; 3];

/// A picture of one or more panels.
#[derive(Clone, Debug)]
pub(super) struct Figure {
    /// Of the files, without what they are.
    pub(super) name: String,
    pub(super) title: String,
    /// What was measured, in a line or more.
    pub(super) subtitle: Vec<String>,
    pub(super) panels: Vec<Panel>,
    /// Panels beside each other.
    pub(super) columns: usize,
    /// Width, if words need no more, and height.
    pub(super) panel_size: [i32; 2],
    pub(super) legend: Vec<Entry>,
    /// Below the legend: what a reader must know, and where the numbers come from.
    pub(super) notes: Vec<String>,
}

#[derive(Clone, Debug)]
pub(super) struct Panel {
    pub(super) title: String,
    pub(super) x: Axis,
    pub(super) y: Axis,
    pub(super) curves: Vec<Curve>,
    /// Levels that are said in the literature.
    pub(super) levels: Vec<Level>,
}

#[derive(Clone, Debug)]
pub(super) struct Axis {
    pub(super) label: String,
    pub(super) is_log: bool,
    pub(super) range: [f64; 2],
    /// Of a logarithmic axis: zero has a place at the low end, which is labelled so.
    pub(super) has_zero: bool,
    /// Labelled values, where they are not all round ones.
    pub(super) ticks: Option<Vec<(f64, String)>>,
}

/// A horizontal line with a text.
#[derive(Clone, Debug)]
pub(super) struct Level {
    pub(super) y: f64,
    pub(super) label: String,
}

/// How a curve and its points look.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Look {
    pub(super) color: Color,
    pub(super) mark: Mark,
    pub(super) line: Line,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mark {
    Disc,
    Ring,
    Square,
    Triangle,
    Diamond,
    Cross,
    Star,
    None,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Line {
    None,
    Thin,
    Thick,
    Dashed,
    /// So wide that words fit in: the label of its first point.
    Bar,
}

#[derive(Clone, Debug)]
pub(super) struct Curve {
    pub(super) look: Look,
    pub(super) points: Vec<Point>,
}

#[derive(Clone, Debug, Default)]
pub(super) struct Point {
    pub(super) x: f64,
    pub(super) y: f64,
    /// Spread along x.
    pub(super) x_spread: Option<[f64; 2]>,
    /// Spread along y.
    pub(super) y_spread: Option<[f64; 2]>,
    pub(super) label: Option<String>,
}

/// A line of the legend.
#[derive(Clone, Debug)]
pub(super) struct Entry {
    pub(super) look: Look,
    pub(super) label: String,
}

impl Look {
    /// Marks that no line joins.
    pub(super) fn marks(color: Color, mark: Mark) -> Self {
        Self {
            color,
            mark,
            line: Line::None,
        }
    }
}

impl Point {
    /// Without spread and label.
    pub(super) fn new(x: f64, y: f64) -> Self {
        Self {
            x,
            y,
            ..Self::default()
        }
    }
}

/// Points without spread and label.
pub(super) fn points(places: impl IntoIterator<Item = (f64, f64)>) -> Vec<Point> {
    let places = places.into_iter();
    places.map(|(x, y)| Point::new(x, y)).collect()
}

impl Entry {
    pub(super) fn new(look: Look, label: impl Into<String>) -> Self {
        let label = label.into();
        Self { look, label }
    }
}

impl Panel {
    /// Without levels.
    pub(super) fn new(title: impl Into<String>, x: Axis, y: Axis, curves: Vec<Curve>) -> Self {
        Self {
            title: title.into(),
            x,
            y,
            curves,
            levels: Vec::new(),
        }
    }
}

impl Axis {
    /// A linear axis that shows just this range.
    pub(super) fn over(label: &str, range: [f64; 2]) -> Self {
        Self {
            label: label.to_owned(),
            is_log: false,
            range,
            has_zero: false,
            ticks: None,
        }
    }

    /// A linear axis over these values and one more on both sides.
    pub(super) fn around(label: &str, values: impl Iterator<Item = f64>) -> Self {
        let (low, high) = values.fold((f64::MAX, f64::MIN), |(low, high), value| {
            (low.min(value), high.max(value))
        });
        Self::over(label, [low - 1.0, high + 1.0])
    }

    /// A logarithmic axis over the positive ones of these values, a little wider.
    pub(super) fn log(label: &str, values: impl IntoIterator<Item = f64>) -> Self {
        let (mut low, mut high, mut has_zero) = (f64::MAX, f64::MIN, false);
        for value in values {
            if value > 0.0 {
                (low, high) = (low.min(value), high.max(value));
            } else {
                has_zero = true;
            }
        }
        if low > high {
            (low, high) = (0.1, 1.0);
        }
        Self {
            is_log: true,
            has_zero,
            ..Self::over(label, [low / 1.25, high * 1.25])
        }
    }

    /// A linear axis from zero, or the least value, to the greatest, a little wider.
    pub(super) fn linear(label: &str, values: impl IntoIterator<Item = f64>) -> Self {
        let (low, high) = values
            .into_iter()
            .fold((0.0, f64::MIN), |(low, high), value| {
                (f64::min(low, value), f64::max(high, value))
            });
        let high = if high > low { high } else { low + 1.0 };
        let margin = 0.03 * (high - low);
        Self::over(label, [low - margin, high + margin])
    }

    /// Where a value is between the ends of the axis, 0 to 1.
    pub(super) fn place(&self, value: f64) -> f64 {
        let [low, high] = self.range;
        if !self.is_log {
            return (value - low) / (high - low);
        }
        let place = (value.max(f64::MIN_POSITIVE) / low).ln() / (high / low).ln();
        if !self.has_zero {
            return place;
        }
        if value > 0.0 {
            ZERO_SHARE + (1.0 - ZERO_SHARE) * place
        } else {
            0.5 * ZERO_SHARE
        }
    }
}

/// Share of a logarithmic axis that is left for zero.
pub(super) const ZERO_SHARE: f64 = 0.08;

/// Texts, each in a line of its own.
pub(super) fn lines<const N: usize>(texts: [&str; N]) -> Vec<String> {
    texts.map(str::to_owned).to_vec()
}

/// `figure` with a number where others have its name: of two runs of one model.
pub(super) fn numbered(others: &[Figure], figure: Figure) -> Figure {
    let is_alike = |other: &&Figure| other.name.starts_with(&figure.name);
    let name = match others.iter().filter(is_alike).count() {
        0 => figure.name.clone(),
        count => format!("{}_{}", figure.name, count + 1),
    };
    Figure { name, ..figure }
}
