//! Every stage is valid WGSL, needs no more than the core of WebGPU, and declares what it uses. No
//! adapter is needed.

use naga::valid::{Capabilities, GlobalUse, ValidationFlags, Validator};
use std::collections::BTreeSet;
use tldi_shaders::{STAGES, UNPROJECT};

#[test]
fn every_stage_is_valid_and_declares_its_bindings() {
    for stage in STAGES.iter().chain([&UNPROJECT]) {
        let module = naga::front::wgsl::parse_str(stage.source)
            .unwrap_or_else(|e| panic!("{}: {}", stage.name, e.emit_to_string(stage.source)));
        let info = Validator::new(ValidationFlags::all(), Capabilities::empty())
            .validate(&module)
            .unwrap_or_else(|e| panic!("{}: {}", stage.name, e.emit_to_string(stage.source)));
        let entry = (module.entry_points.iter())
            .position(|entry| entry.name == stage.name)
            .unwrap_or_else(|| panic!("{} has no entry point of its name", stage.name));
        let uses = info.get_entry_point(entry);
        let used: BTreeSet<u32> = (module.global_variables.iter())
            .filter(|(handle, _)| uses[*handle] != GlobalUse::empty())
            .filter_map(|(_, variable)| variable.binding.as_ref())
            .map(|binding| binding.binding)
            .collect();
        let declared: BTreeSet<u32> = stage.bindings.iter().copied().collect();
        assert_eq!(used, declared, "{}", stage.name);
        // What every device has (`Limits::default()`) is eight storage buffers, and one uniform here. One is spare.
        assert!(used.len() <= 8, "{}: {used:?}", stage.name);
    }
}

/// What is not as it should be of the loop in `line`, below `above`.
fn fault_of_loop(above: &str, line: &str) -> Option<&'static str> {
    let line = line.trim();
    if line == "loop {" || line.starts_with("while ") {
        return (!above.trim().starts_with("// Ends: ")).then_some("it does not say why it ends");
    }
    let head = line.strip_prefix("for (var ")?.strip_suffix(") {")?;
    let [start, condition, step] = head.split("; ").collect::<Vec<_>>()[..] else {
        return Some("it has no start, condition and step");
    };
    let counter = start.split(" = ").next().unwrap_or_default();
    let rises = [" < ", " <= "]
        .iter()
        .any(|than| condition.starts_with(&format!("{counter}{than}")));
    let falls = condition.starts_with(&format!("{counter} > "));
    let is_up = step == format!("{counter}++") || step.starts_with(&format!("{counter} += "));
    let is_down = step == format!("{counter}--");
    let is_compound = condition.contains("&&") || condition.contains("||");
    let ends = !is_compound && (rises && is_up || falls && is_down);
    (!ends).then_some("it does not count towards its bound")
}

/// Shaders are compiled without counters in their loops, so each of these must end: a `for` counts towards its bound, and what is
/// no such loop says above it why it ends.
#[test]
fn every_loop_ends() {
    let mut loops = 0;
    for stage in STAGES.iter().chain([&UNPROJECT]) {
        let lines: Vec<&str> = stage.source.lines().collect();
        for pair in lines.windows(2) {
            let fault = fault_of_loop(pair[0], pair[1]);
            assert_eq!(fault, None, "{}: {}", stage.name, pair[1].trim());
            loops += usize::from(pair[1].trim().ends_with('{') && is_loop(pair[1]));
        }
    }
    assert!(loops > 100, "{loops}");
    for (above, line) in [
        ("", "loop {"),
        ("// It ends.", "while k > 0u {"),
        ("", "for (var k = 0u; k < n; k--) {"),
        ("", "for (var k = n; k > 0u; k++) {"),
        ("", "for (var k = 0u; i < n; k++) {"),
        ("", "for (var k = 0u; k < n || k > m; k++) {"),
    ] {
        assert!(fault_of_loop(above, line).is_some(), "{line}");
    }
}

fn is_loop(line: &str) -> bool {
    ["for ", "while ", "loop "]
        .iter()
        .any(|word| line.trim().starts_with(word))
}
