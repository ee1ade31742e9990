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
