//! Of WGSL's operators that are mixed, brackets say which comes first. Browsers refuse shaders that leave it open; `naga` does
//! not.

use tldi_shaders::{STAGES, UNPROJECT};

const COMPARISONS: [&str; 6] = ["<", ">", "<=", ">=", "==", "!="];
const OPERATORS: [&str; 18] = [
    "<<", ">>", "<=", ">=", "==", "!=", "&&", "||", "+", "-", "*", "/", "%", "&", "|", "^", "<",
    ">",
];
/// What is no operator of two values, or takes the value of all on its right.
const OTHERS: [&str; 13] = [
    "<<=", ">>=", "->", "++", "--", "+=", "-=", "*=", "/=", "%=", "&=", "|=", "^=",
];
/// What types in angle brackets follow.
const TEMPLATES: [&str; 6] = ["array", "atomic", "bitcast", "ptr", "var", "vec2"];

/// What of the operators between two brackets, commas or assignments is left open.
fn fault_of(operators: &[&str]) -> Option<&'static str> {
    let has = |some: &[&str]| operators.iter().any(|o| some.contains(o));
    if has(&["&&"]) && has(&["||"]) {
        return Some("`&&` and `||`");
    }
    if has(&["&", "|", "^"]) && operators.windows(2).any(|pair| pair[0] != pair[1]) {
        return Some("one of `&`, `|` and `^`, and another operator");
    }
    let ends = |o: &&str| COMPARISONS.contains(o) || ["&&", "||"].contains(o);
    let mut sides = operators.split(ends);
    let is_mixed = |side: &[&str]| side.len() > 1 && side.iter().any(|o| ["<<", ">>"].contains(o));
    sides
        .any(is_mixed)
        .then_some("a shift and another operator")
}

/// The faults of a shader, with their lines.
fn faults(source: &str) -> Vec<(usize, &'static str)> {
    let mut faults = Vec::new();
    let mut open: Vec<Vec<&str>> = vec![Vec::new()];
    let (mut before, mut follows_value, mut types) = ("", false, 0);
    for (number, line) in (1..).zip(source.lines()) {
        let mut rest = line.split("//").next().unwrap_or_default();
        while let Some(first) = rest.chars().next() {
            let is_word = |c: char| c.is_alphanumeric() || c == '_' || c == '.';
            let known = || (OTHERS.iter().chain(&OPERATORS)).find(|o| rest.starts_with(**o));
            let length = match is_word(first) {
                true => rest.find(|c| !is_word(c)).unwrap_or(rest.len()),
                false => known().map_or(first.len_utf8(), |o| o.len()),
            };
            let (token, after) = rest.split_at(length);
            rest = after;
            if token.trim().is_empty() {
                continue;
            }
            if types > 0 || token == "<" && TEMPLATES.contains(&before) {
                types += token.matches('<').count();
                types -= token.matches('>').count();
                (before, follows_value) = (token, true);
                continue;
            }
            if OPERATORS.contains(&token) {
                // Else it is a sign, a reference or a pointer's value.
                if follows_value && let Some(operators) = open.last_mut() {
                    operators.push(token);
                }
            } else if !is_word(first) && !["(", "[", "!", "~"].contains(&token) {
                let fault = open.last().and_then(|operators| fault_of(operators));
                faults.extend(fault.map(|fault| (number, fault)));
                if [")", "]", "}"].contains(&token) {
                    open.pop();
                } else if let Some(operators) = open.last_mut() {
                    operators.clear();
                }
            }
            if ["(", "[", "{"].contains(&token) {
                open.push(Vec::new());
            }
            follows_value = is_word(first) || [")", "]"].contains(&token);
            before = token;
        }
    }
    faults
}

#[test]
fn brackets_say_which_operator_comes_first() {
    for stage in STAGES.iter().chain([&UNPROJECT]) {
        let lines: Vec<&str> = stage.source.lines().collect();
        let found = faults(stage.source).into_iter();
        let told: Vec<String> = found
            .map(|(line, fault)| format!("{fault}: {}", lines[line - 1].trim()))
            .collect();
        assert!(told.is_empty(), "{}: {told:?}", stage.name);
    }
    for (code, is_left_open) in [
        ("let a = b << c | d;", true),
        ("let a = (b << c) | d;", false),
        ("let a = b | c * d;", true),
        ("f(b, c & d == e);", true),
        ("let a = b & c & ~d;", false),
        ("let a = b & c | d;", true),
        ("let a = b + c << d;", true),
        ("if b >> c == d >> e && f { g |= h << i; }", false),
        ("if b && c || d {", true),
        ("if b && (c || d) {", false),
        ("if b == c { d = e & f; }", false),
        ("let a = bitcast<u32>(b) & c;", false),
        ("*b = -c;\nvar d = e\n    & f;", false),
        (
            "for (var k = b; k < c; k++) {\n    d[k & e] += f;\n}",
            false,
        ),
    ] {
        assert_eq!(!faults(code).is_empty(), is_left_open, "{code}");
    }
}
