//! The commands in the README and in the documents run as they are printed.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Blocks of shell commands in a page, without those for building; blocks in lists lose their indentation.
fn blocks(page: &str) -> Vec<String> {
    let text = fs::read_to_string(root().join(page)).unwrap();
    let mut blocks = Vec::new();
    let mut open: Option<(usize, String)> = None;
    for line in text.lines() {
        let indent = line.len() - line.trim_start().len();
        match (&mut open, line.trim()) {
            (None, "```sh") => open = Some((indent, String::new())),
            (Some(_), "```") => blocks.extend(open.take().map(|(_, block)| block)),
            (Some((indent, block)), _) => {
                block.push_str(line.get(*indent..).unwrap_or_default());
                block.push('\n');
            }
            (None, _) => {}
        }
    }
    blocks.retain(|block| !block.starts_with("make "));
    blocks
}

/// Runs `commands` one after the other in a folder of their own, in which the examples are.
fn run(what: &str, commands: &str) {
    let folder = tempfile::tempdir().unwrap();
    symlink(root().canonicalize().unwrap().join("examples"), folder.path().join("examples")).unwrap();
    let program = Path::new(env!("CARGO_BIN_EXE_echocast"));
    let path = std::env::var("PATH").unwrap_or_default();
    // What Blender would write: tests have no Blender.
    let script = format!("set -euo pipefail\nblender() {{ cp examples/scenes/apartment.glb mine.glb; }}\n{commands}");
    let output = Command::new("bash")
        .args(["-c", &script])
        .current_dir(folder.path())
        .env("PATH", format!("{}:{path}", program.parent().unwrap().display()))
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{what}:\n{commands}\n{said}");
    assert!(!said.contains("error:"), "{what}: {said}");
}

#[test]
fn commands_of_the_readme_run() {
    let blocks = blocks("README.md");
    assert!(blocks.len() >= 3, "{blocks:?}");
    run("README.md", &blocks.concat());
}

#[test]
fn commands_of_the_page_on_motion_run() {
    let blocks = blocks("docs/motion.md");
    assert!(blocks.len() >= 3, "{blocks:?}");
    run("docs/motion.md", &blocks.concat());
}

#[test]
fn commands_of_the_page_on_scenarios_run() {
    let text = fs::read_to_string(root().join("docs/scenario.md")).unwrap();
    let yaml = text.split("```yaml\n").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    // Few samples are enough to see that it runs.
    let write = format!("cat > drive.yaml <<'END'\n{yaml}END\nsed -i 's/samples: 100/samples: 4/' drive.yaml\n");
    let commands = blocks("docs/scenario.md").concat().replace("--sample 17", "--sample 3").replace("=200", "=6");
    assert!(commands.contains("--sample 3") && commands.contains("samples=6"), "{commands}");
    run("docs/scenario.md", &format!("{write}{commands}"));
}
