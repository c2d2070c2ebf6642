//! The examples in the header, in `docs/embedding.md`, in `docs/motion.md` and in the README compile, and show every
//! function.

mod common;

use common::{compilers, folder, include, run};
use std::fs;
use std::path::Path;
use std::process::Command;

/// What the examples take as given.
const GIVEN: &str = r#"
#include <echocast.h>
#include <stdio.h>
#include <stdlib.h>
enum { ROBOT_BIT = 2 };
extern echocast_context *context;
extern echocast_scene *scene;
extern echocast_snapshot *snapshot;
extern echocast_sensor *sensor;
extern echocast_result *result;
extern echocast_scenario *scenario;
extern echocast_sample *sample;
extern echocast_material *material;
extern echocast_mesh *mesh, *car_mesh;
extern echocast_instance instance;
extern echocast_scan_desc scan;
extern echocast_pose poses[101];
extern float positions[300], bent[600];
extern uint32_t indices[300], vertex_count, triangle_count;
extern int64_t period;
extern double value, least, greatest;
extern unsigned char bytes[1024], message[1024];
extern size_t message_size;
void check(echocast_status status);
void on_message(void *user, int32_t level, const char *text);
void on_released(void *user);
"#;

/// What the examples in C++ take as given.
const GIVEN_CPP: &str = "
#include <echocast.hpp>
void use(float value);
";

/// Blocks of a `language` in a text; lines of a comment lose their star.
fn blocks(text: &str, language: &str) -> Vec<String> {
    let fence = format!("```{language}");
    let mut blocks = Vec::new();
    let mut open: Option<String> = None;
    for line in text.lines() {
        let line = line.strip_prefix(" *").map_or(line, |rest| rest.strip_prefix(' ').unwrap_or(rest));
        match (&mut open, line.trim_end()) {
            (None, line) if line == fence => open = Some(String::new()),
            (Some(_), "```") => blocks.extend(open.take()),
            (Some(block), line) => {
                block.push_str(line);
                block.push('\n');
            }
            (None, _) => {}
        }
    }
    blocks
}

#[test]
fn examples_compile_and_show_every_function() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let header = fs::read_to_string(include().join("echocast.h")).unwrap();
    let pages = ["README.md", "docs/embedding.md", "docs/motion.md"];
    let pages = pages.map(|page| fs::read_to_string(root.join(page)).unwrap());
    let examples: Vec<String> = [&header].into_iter().chain(&pages).flat_map(|text| blocks(text, "c")).collect();
    assert!(examples.len() > 12, "{} examples", examples.len());
    let mut program = GIVEN.to_owned();
    for (number, example) in examples.iter().enumerate() {
        program.push_str(&format!("void example_{number}(void);\nvoid example_{number}(void)\n{{\n{example}}}\n"));
    }
    let path = folder("docs").join("examples.c");
    fs::write(&path, program).unwrap();
    for [c, _] in compilers() {
        run(Command::new(c)
            .args(["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-Wno-unused-variable"])
            .args(["-Wno-unused-but-set-variable", "-fsyntax-only", "-I"])
            .arg(include())
            .arg(&path));
    }
    let examples_cpp: Vec<String> = pages.iter().flat_map(|text| blocks(text, "cpp")).collect();
    assert!(!examples_cpp.is_empty());
    let mut program = GIVEN_CPP.to_owned();
    for (number, example) in examples_cpp.iter().enumerate() {
        program.push_str(&format!("void example_{number}();\nvoid example_{number}()\n{{\n{example}}}\n"));
    }
    let path = folder("docs").join("examples.cpp");
    fs::write(&path, program).unwrap();
    for [_, cpp] in compilers() {
        run(Command::new(cpp)
            .args(["-std=c++17", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fsyntax-only", "-I"])
            .arg(include())
            .arg(&path));
    }
    let declared = header
        .split("ECHOCAST_API")
        .skip(1)
        .filter_map(|text| text.split('(').next()?.split([' ', '*', '\n']).next_back());
    let functions: Vec<&str> = declared.filter(|name| name.starts_with("echocast_")).collect();
    assert!(functions.len() > 40);
    let unseen: Vec<&&str> =
        functions.iter().filter(|name| !examples.iter().any(|example| example.contains(&format!("{name}(")))).collect();
    assert!(unseen.is_empty(), "no example shows {unseen:?}");
}
