//! The examples in the header, in `docs/embedding.md`, in `docs/motion.md` and in the README compile, and show every
//! function.

mod common;

use common::{compilers, folder, include, run};
use std::fs;
use std::path::Path;
use std::process::Command;

/// Declarations that the examples assume.
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
extern echocast_pings *pings;
extern echocast_radar *radar;
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

/// Declarations that the examples in C++ assume.
const GIVEN_CPP: &str = "
#include <echocast.hpp>
extern echocast::result points;
extern echocast::scene scene;
extern echocast::sensor sonar;
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

/// Checks that `examples` compile after the declarations `given`, each as a function, with the flags that `add` adds.
fn compile<'c>(
    file: &str,
    given: &str,
    examples: &[String],
    compilers: impl Iterator<Item = &'c &'static str>,
    add: impl Fn(&mut Command),
) {
    let mut program = given.to_owned();
    for (number, example) in examples.iter().enumerate() {
        program.push_str(&format!("void example_{number}(void);\nvoid example_{number}(void)\n{{\n{example}}}\n"));
    }
    let path = folder("docs").join(file);
    fs::write(&path, program).unwrap();
    for compiler in compilers {
        let mut command = Command::new(compiler);
        command.args(["-Wall", "-Wextra", "-Wpedantic", "-Werror"]);
        add(&mut command);
        run(command.args(["-fsyntax-only", "-I"]).arg(include()).arg(&path));
    }
}

#[test]
fn examples_compile_and_show_every_function() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let header = fs::read_to_string(include().join("echocast.h")).unwrap();
    let pages = ["README.md", "docs/embedding.md", "docs/motion.md"];
    let pages = pages.map(|page| fs::read_to_string(root.join(page)).unwrap());
    let examples: Vec<String> = [&header].into_iter().chain(&pages).flat_map(|text| blocks(text, "c")).collect();
    assert!(examples.len() > 12, "{} examples", examples.len());
    compile("examples.c", GIVEN, &examples, compilers().iter().map(|[c, _]| c), |command| {
        command.args(["-std=c99", "-Wno-unused-variable", "-Wno-unused-but-set-variable"]);
    });
    let examples_cpp: Vec<String> = pages.iter().flat_map(|text| blocks(text, "cpp")).collect();
    assert!(!examples_cpp.is_empty());
    compile("examples.cpp", GIVEN_CPP, &examples_cpp, compilers().iter().map(|[_, cpp]| cpp), |command| {
        command.arg("-std=c++17");
    });
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
