//! Tables of a page, and numbers as they are written.

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

/// A table of a page: the first one behind `caption`.
pub(crate) struct Table<'a> {
    pub(crate) caption: &'a str,
    pub(crate) rows: Vec<Vec<&'a str>>,
}

impl<'a> Table<'a> {
    pub(crate) fn new(page: &'a str, caption: &'a str) -> Self {
        let (_, behind) = (page.split_once(caption)).unwrap_or_else(|| panic!("no {caption:?}"));
        let lines = behind.lines().map(str::trim);
        let table = lines.skip_while(|line| !line.starts_with('|'));
        let rows = table.take_while(|line| line.starts_with('|'));
        let cells = |line: &'a str| line.trim_matches('|').split('|').map(str::trim).collect();
        Self {
            caption,
            rows: rows.map(cells).collect(),
        }
    }

    /// Compares every cell behind the first of every row with what `expected` has for the row's name and the cell's
    /// number. `None`: the cell has no number. Rows that are about nothing measured have no entry (`is_row`).
    pub(crate) fn check(
        &self,
        wrong: &mut Vec<String>,
        is_row: impl Fn(&str) -> bool,
        expected: impl Fn(&str, usize) -> Option<Vec<f64>>,
    ) {
        let mut checked = 0;
        for row in self.rows.iter().skip(2).filter(|row| is_row(row[0])) {
            for (k, cell) in row[1..].iter().enumerate() {
                let expected = expected(row[0], k).unwrap_or_default();
                let shown = numbers(cell);
                let agree = shown.len() == expected.len()
                    && shown.iter().zip(&expected).all(|(s, v)| is_rounded(s, *v));
                if !agree {
                    let Self { caption, .. } = self;
                    wrong.push(format!("{caption}: {}: {cell:?} is {expected:.4?}", row[0]));
                }
                checked += 1;
            }
        }
        assert!(checked > 3, "{}: {checked} cells", self.caption);
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
