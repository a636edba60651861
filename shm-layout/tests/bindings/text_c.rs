//! The messages → `bindings/tennis_messages.h`, and a program that says how C lays them out.

use crate::layout::{
    Field, SERVICES, about, about_code, about_field, codes, layouts, type_name_of,
};
use shm_layout::launcher::{COMMAND_AGE_MAX_NS, NONE};
use shm_layout::services::MAX_NODES;
use std::fmt::Write as _;

const HEAD: &str = r#"/* Messages of a court in shared memory: SI units, court frame.
 *
 * Generated from shm-layout/src by shm-layout/tests/bindings; that test holds this file to it. NaN
 * stands for what was not observed. Stamps are on CLOCK_BOOTTIME of this computer. Each service is
 * one of iceoryx2 0.10 with an event of the same name; the names of types and the numbers of ports
 * that it asks for stand below. Prefix of the files: tennis_COURT_fusion_, root path:
 * /tmp/tennis-UID/.
 */
#ifndef TENNIS_MESSAGES_H
#define TENNIS_MESSAGES_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
#define TENNIS_ASSERT(is_so, words) static_assert(is_so, words)
#else
#define TENNIS_ASSERT(is_so, words) _Static_assert(is_so, words)
#endif
"#;

const TAIL: &str = r#"
/* Why these settings may not be sent: TENNIS_WHY_NOTHING if they may. Bounds are within, and not a
 * number is in no range. */
static inline enum tennis_why tennis_refusal(const struct tennis_limits *limits,
                                             const struct tennis_settings *settings) {
    const struct tennis_settings *min = &limits->min, *max = &limits->max;
    if (!(settings->speed_m_s >= min->speed_m_s && settings->speed_m_s <= max->speed_m_s))
        return TENNIS_WHY_SPEED;
    if (!(settings->elevation_rad >= min->elevation_rad &&
          settings->elevation_rad <= max->elevation_rad))
        return TENNIS_WHY_ELEVATION;
    if (!(settings->azimuth_rad >= min->azimuth_rad && settings->azimuth_rad <= max->azimuth_rad))
        return TENNIS_WHY_AZIMUTH;
    if (!(settings->backspin_rad_s >= min->backspin_rad_s &&
          settings->backspin_rad_s <= max->backspin_rad_s))
        return TENNIS_WHY_BACKSPIN;
    return TENNIS_WHY_NOTHING;
}

#endif
"#;

/// The whole header.
pub fn text() -> String {
    let mut out = HEAD.to_owned();
    writeln!(out, "\n/* In place of an index: there is none. */").unwrap();
    assert_eq!(NONE, u64::MAX);
    writeln!(out, "#define TENNIS_NONE UINT64_MAX").unwrap();
    writeln!(out, "/* A command older than this is not obeyed, ns. */").unwrap();
    writeln!(out, "#define TENNIS_COMMAND_AGE_MAX_NS INT64_C({COMMAND_AGE_MAX_NS})").unwrap();
    writeln!(out, "/* Most processes in a domain. */\n#define TENNIS_MAX_NODES {MAX_NODES}")
        .unwrap();
    for codes in codes() {
        let name = snake(codes.name);
        writeln!(out, "\n{}\nenum tennis_{name} {{", comment("", &about(codes.name))).unwrap();
        for (code, text) in codes.texts.iter().enumerate() {
            let variant = format!("TENNIS_{name}_{}", text.replace(' ', "_")).to_uppercase();
            let about = comment("    ", &about_code(codes.name, text));
            writeln!(out, "{about}\n    {variant} = {code},").unwrap();
        }
        writeln!(out, "}};").unwrap();
    }
    for layout in layouts() {
        let name = snake(layout.name);
        writeln!(out, "\n{}\nstruct tennis_{name} {{", comment("", &about(layout.name))).unwrap();
        for field in &layout.fields {
            writeln!(out, "{}", comment("    ", &about_field(layout.name, field.name))).unwrap();
            let lengths: String = field.lengths.iter().map(|n| format!("[{n}]")).collect();
            writeln!(out, "    {} {}{lengths};", ctype(field), field.name).unwrap();
        }
        writeln!(out, "}};").unwrap();
        let type_name = type_name_of(layout.name);
        writeln!(out, "#define TENNIS_{}_TYPE \"{type_name}\"", name.to_uppercase()).unwrap();
        let (bytes, label) = (layout.n_bytes, layout.name);
        writeln!(
            out,
            "TENNIS_ASSERT(sizeof(struct tennis_{name}) == {bytes}, \"bytes of {label}\");"
        )
        .unwrap();
        for field in &layout.fields {
            let (field, offset) = (field.name, field.offset);
            writeln!(
                out,
                "TENNIS_ASSERT(offsetof(struct tennis_{name}, {field}) == {offset}, \"{field}\");"
            )
            .unwrap();
        }
    }
    for row in SERVICES {
        let prefix = format!("TENNIS_{}", row.name.replace('-', "_").to_uppercase());
        writeln!(out, "\n/* Service of {}. */", row.message).unwrap();
        writeln!(out, "#define {prefix}_SERVICE \"{}\"", row.name).unwrap();
        for (what, n) in [("WRITERS", row.writers), ("READERS", row.readers), ("DEPTH", row.depth)]
        {
            writeln!(out, "#define {prefix}_{what}_MAX {n}").unwrap();
        }
    }
    out + TAIL
}

/// A program that prints every message's name, size and fields, and what is said of settings for
/// limits of 0 to 1.
pub fn program(settings: &[[f64; 4]]) -> String {
    let mut out =
        "#include <math.h>\n#include <stdio.h>\n#include \"tennis_messages.h\"\n".to_owned();
    out += "int main(void) {\n";
    for layout in layouts() {
        let kind = format!("struct tennis_{}", snake(layout.name));
        writeln!(out, "    printf(\"{} %zu\", sizeof({kind}));", layout.name).unwrap();
        for field in &layout.fields {
            let name = field.name;
            let offset = format!("offsetof({kind}, {name})");
            let size = format!("sizeof((({kind} *)0)->{name})");
            writeln!(out, "    printf(\" {name}=%zu+%zu\", {offset}, {size});").unwrap();
        }
        writeln!(out, "    printf(\"\\n\");").unwrap();
    }
    writeln!(out, "    struct tennis_limits limits = {{{{0, 0, 0, 0}}, {{1, 1, 1, 1}}}};").unwrap();
    for (idx, row) in settings.iter().enumerate() {
        let row = row.map(|value| match value {
            value if value.is_nan() => "NAN".to_owned(),
            f64::INFINITY => "INFINITY".to_owned(),
            value => format!("{value:?}"),
        });
        let end = if idx + 1 == settings.len() { "\\n" } else { " " };
        writeln!(out, "    struct tennis_settings s{idx} = {{{}}};", row.join(", ")).unwrap();
        writeln!(out, "    printf(\"%d{end}\", (int)tennis_refusal(&limits, &s{idx}));").unwrap();
    }
    out + "    return 0;\n}\n"
}

fn ctype(field: &Field) -> String {
    match field.base {
        "u32" => "uint32_t".to_owned(),
        "u64" => "uint64_t".to_owned(),
        "i64" => "int64_t".to_owned(),
        "f64" => "double".to_owned(),
        message => format!("struct tennis_{}", snake(message)),
    }
}

fn comment(indent: &str, lines: &[String]) -> String {
    format!("{indent}/* {} */", lines.join(&format!("\n{indent} * ")))
}

fn snake(name: &str) -> String {
    let mut snake = String::new();
    for c in name.chars() {
        if c.is_ascii_uppercase() && !snake.is_empty() {
            snake.push('_');
        }
        snake.push(c.to_ascii_lowercase());
    }
    snake
}
