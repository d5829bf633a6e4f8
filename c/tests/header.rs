//! The header is what the sources say. With `ROTORLEAD_UPDATE_PAGES=1` in the environment it is written instead.

use std::path::Path;

use cbindgen::{Braces, Builder, Config, DocumentationStyle, EnumConfig, ExportConfig, Language, RenameRule, Style};

/// Above the first line of code.
const ABOVE: &str = "\
/*
 * Rotorlead for firmware in C99 or later, or C++11 or later. MIT license.
 *
 * No function allocates memory, waits, or keeps anything but in the compensator that it gets. A compensator belongs to one
 * task at a time. Every function says how it ended: docs/c-interface.md.
 *
 * Written by `cargo xtask docs` from c/src.
 */";

/// Below the last one: what the sources assert of the size, asserted on the other side.
const BELOW: &str = "\
#if defined(__cplusplus)
static_assert(sizeof(rotorlead_compensator) == 4 * ROTORLEAD_COMPENSATOR_WORDS, \"a packed compensator\");
#elif defined(__STDC_VERSION__) && __STDC_VERSION__ >= 201112L
_Static_assert(sizeof(rotorlead_compensator) == 4 * ROTORLEAD_COMPENSATOR_WORDS, \"a packed compensator\");
#endif";

fn config() -> Config {
    let types = ["Command", "Compensator", "Inverse", "Lead", "Point", "Status"];
    let constant = ("COMPENSATOR_WORDS".to_owned(), "ROTORLEAD_COMPENSATOR_WORDS".to_owned());
    let rename = types.map(|name| (name.to_owned(), format!("rotorlead_{}", name.to_lowercase())));
    Config {
        language: Language::C,
        cpp_compat: true,
        header: Some(ABOVE.to_owned()),
        trailer: Some(BELOW.to_owned()),
        include_guard: Some("ROTORLEAD_H".to_owned()),
        no_includes: true,
        sys_includes: ["stddef.h", "stdint.h"].map(str::to_owned).to_vec(),
        usize_is_size_t: true,
        braces: Braces::SameLine,
        style: Style::Both,
        line_length: 120,
        tab_width: 4,
        documentation_style: DocumentationStyle::C99,
        enumeration: EnumConfig {
            rename_variants: RenameRule::ScreamingSnakeCase,
            prefix_with_name: true,
            ..EnumConfig::default()
        },
        export: ExportConfig { rename: rename.into_iter().chain([constant]).collect(), ..ExportConfig::default() },
        ..Config::default()
    }
}

#[test]
fn the_header_is_what_the_sources_say() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut written = Vec::new();
    Builder::new().with_config(config()).with_src(root.join("src/lib.rs")).generate().unwrap().write(&mut written);
    // The heading is one of Rust's.
    let written = String::from_utf8(written).unwrap().replace("// # Safety\n", "");

    let path = root.join("include/rotorlead.h");
    if std::env::var_os("ROTORLEAD_UPDATE_PAGES").is_some() {
        std::fs::write(&path, &written).unwrap();
    }
    let header = std::fs::read_to_string(&path).unwrap();
    assert!(header == written, "{} is not what the sources say: `cargo xtask docs` writes it", path.display());
}
