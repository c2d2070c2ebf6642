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

fn program() -> &'static Path {
    Path::new(env!("CARGO_BIN_EXE_echocast"))
}

/// Runs `commands` one after the other in a folder of their own, in which the examples are.
fn run(what: &str, commands: &str) {
    let folder = tempfile::tempdir().unwrap();
    symlink(root().canonicalize().unwrap().join("examples"), folder.path().join("examples")).unwrap();
    // Where shells keep completions.
    fs::create_dir_all(folder.path().join(".config/fish/completions")).unwrap();
    // A debug build is slow: fewer beams and frames are enough to see that they run.
    let quicker = [
        ("velodyne_vls128 --camera Corner", "vlp16 --camera Corner"),
        ("velodyne_hdl64e --trajectory", "vlp16 --trajectory"),
        ("ouster_os1_128 --camera", "vlp16 --camera"),
        ("riegl_vux1uav22 --trajectory", "riegl_vux1uav22 --set beam.sub_rays=1 --trajectory"),
        (" 20:39 ", " 20:23 "),
        (" 0:19 ", " 0:4 "),
        (" 0:9 ", " 0:2 "),
    ];
    let commands = quicker.iter().fold(commands.to_owned(), |commands, (from, to)| commands.replace(from, to));
    let path = std::env::var("PATH").unwrap_or_default();
    // What Blender would write: tests have no Blender.
    let script = format!(
        "set -euo pipefail\nblender() {{ cp examples/scenes/apartment.glb mine.glb; }}\nfpath=(. .)\n{commands}"
    );
    let output = Command::new("bash")
        .args(["-c", &script])
        .current_dir(folder.path())
        .env("HOME", folder.path())
        .env("PATH", format!("{}:{path}", program().parent().unwrap().display()))
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
fn commands_of_the_pages_on_surveys_run() {
    for page in ["docs/survey.md", "docs/survey-plans.md", "docs/survey-trajectories.md", "docs/survey-helios.md"] {
        run(page, &blocks(page).concat());
    }
}

#[test]
fn commands_of_the_page_on_files_run() {
    run("docs/files.md", &blocks("docs/files.md").concat());
}

#[test]
fn commands_of_the_page_on_motion_run() {
    let blocks = blocks("docs/motion.md");
    assert!(blocks.len() >= 3, "{blocks:?}");
    run("docs/motion.md", &blocks.concat());
}

#[test]
fn commands_of_the_page_on_robots_run() {
    let blocks = blocks("docs/robots.md");
    assert!(blocks.concat().contains("--joint mast_joint=0.8"), "{blocks:?}");
    run("docs/robots.md", &blocks.concat());
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

/// Help of a command.
fn help(command: &[String]) -> String {
    let output = Command::new(program()).args(command).arg("--help").output().unwrap();
    String::from_utf8(output.stdout).unwrap()
}

/// Lines of `help` below `heading`, as far as the next empty line.
fn below<'a>(help: &'a str, heading: &str) -> impl Iterator<Item = &'a str> {
    help.lines().skip_while(move |line| !line.starts_with(heading)).skip(1).take_while(|line| !line.is_empty())
}

/// Subcommands of `command`, and their own.
fn commands_of(command: &[String]) -> Vec<Vec<String>> {
    let help = help(command);
    let names = below(&help, "Commands:").filter_map(|line| line.split_whitespace().next());
    let within = names.filter(|name| *name != "help").map(|name| [command, &[name.to_owned()]].concat());
    within.flat_map(|inner| [vec![inner.clone()], commands_of(&inner)].concat()).collect()
}

#[test]
fn examples_in_the_help_run() {
    let mut commands = commands_of(&[]);
    assert!(commands.iter().any(|command| *command == ["generate", "seabed"]), "{commands:?}");
    commands.push(Vec::new());
    for command in commands {
        let help = help(&command);
        // Lines that are not indented describe what follows.
        let examples: Vec<_> = below(&help, "Example").filter(|line| line.starts_with(' ')).collect();
        assert!(examples.iter().any(|line| line.contains("echocast ")), "{command:?} has no example:\n{help}");
        run(&format!("echocast {} --help", command.join(" ")), &(examples.join("\n") + "\n"));
    }
}
