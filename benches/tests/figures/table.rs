//! Tables of a page, and numbers as they are written.

use crate::page;

/// The numbers in a text, as written.
pub(crate) fn numbers(text: &str) -> Vec<String> {
    let mut all = Vec::new();
    let mut current = String::new();
    for c in text.chars().chain([' ']) {
        let goes_on = matches!(c, '.' | ',') && !current.is_empty();
        if c.is_ascii_digit() || goes_on {
            current.push(c);
        } else if !current.is_empty() {
            all.push(current.trim_end_matches(['.', ',']).replace(',', ""));
            current.clear();
        }
    }
    all
}

/// Whether a number is `value`, rounded to the digits shown. Zeros at the end of a whole number may be rounded, too.
pub(crate) fn is_rounded(shown: &str, value: f64) -> bool {
    let digits = shown.split_once('.').map_or(0, |(_, digits)| digits.len());
    let parsed: f64 = shown.parse().expect("a number");
    // What lies on the border between two roundings may be shown as either.
    let step = 10f64.powi(-(digits as i32));
    (parsed - value).abs() <= 0.5 * step * (1.0 + 1e-6)
}

/// A table of a page.
pub(crate) struct Table {
    caption: String,
    /// Cells of each row below the head.
    pub(crate) rows: Vec<Vec<String>>,
}

impl Table {
    /// The first one from `caption` on, which may be the beginning of its head.
    pub(crate) fn read(page_name: &str, caption: &str) -> Self {
        let page = page(page_name);
        let start = page.find(caption);
        let start = start.unwrap_or_else(|| panic!("{page_name}: no {caption:?}"));
        let lines = page[start..].lines().map(str::trim);
        let table = lines.skip_while(|line| !line.starts_with('|'));
        let rows = table.take_while(|line| line.starts_with('|')).skip(2);
        let cells = |line: &str| {
            let cells = line.trim_matches('|').split('|');
            cells.map(|cell| cell.trim().to_owned()).collect()
        };
        Self {
            caption: caption.to_owned(),
            rows: rows.map(cells).collect(),
        }
    }

    /// Only the rows of these names: others are about nothing measured.
    pub(crate) fn only(mut self, is_row: impl Fn(&str) -> bool) -> Self {
        self.rows.retain(|row| is_row(&row[0]));
        self
    }

    /// Compares every cell behind the first of every row with what `expected` has for the row's name and the cell's
    /// number. `None`: the cell has no number.
    pub(crate) fn check(&self, expected: impl Fn(&str, usize) -> Option<Vec<f64>>) {
        let (mut checked, mut wrong) = (0, Vec::new());
        for row in &self.rows {
            for (k, cell) in row[1..].iter().enumerate() {
                let expected = expected(&row[0], k).unwrap_or_default();
                let shown = numbers(cell);
                let agree = shown.len() == expected.len()
                    && shown.iter().zip(&expected).all(|(s, v)| is_rounded(s, *v));
                if !agree {
                    wrong.push(format!("{}: {cell:?} is {expected:.4?}", row[0]));
                }
                checked += 1;
            }
        }
        let caption = &self.caption;
        assert!(wrong.is_empty(), "{caption}:\n{}", wrong.join("\n"));
        assert!(checked > 3, "{caption}: {checked} cells");
    }
}

#[test]
fn roundings() {
    assert_eq!(
        numbers("0.15 (0.02) at 0.15 r, 1,018"),
        ["0.15", "0.02", "0.15", "1018"]
    );
    assert!(is_rounded("0.018", 0.01792) && !is_rounded("0.018", 0.0186));
    assert!(is_rounded("2024", 2023.6) && !is_rounded("2024", 2025.1));
}
