//! Scenarios whose scene is a file of Blender: Blender opens it, and its add-on runs this program inside.

use crate::usage;
use anyhow::{Result, anyhow};
use echocast::{Error, shown};
use std::ffi::OsString;
use std::os::unix::process::CommandExt as _;
use std::path::Path;
use std::process::Command;

/// The environment variable with the path of Blender, or of a Python that has it as the module `bpy`.
const PROGRAM: &str = "ECHOCAST_BLENDER";

/// What Blender does once the file is open: its own messages are on stderr, file 3 is what was stdout.
const INSIDE: &str = "\
import os, sys
try:
    import echocast_blender
except ImportError as error:
    sys.stderr.write(f'error: this Blender cannot load the add-on echocast_blender: {error}\\n')
    sys.exit(1)
code = echocast_blender.program(sys.argv[sys.argv.index('--') + 1:])
sys.stdout.flush()
sys.stderr.flush()
# As a module, some versions of Blender crash when Python ends.
os._exit(code)
";

/// Replaces this process by Blender, which opens `file` and continues with the command line `arguments`. Returns only if
/// that fails.
pub fn run(file: &Path, arguments: &[OsString]) -> Result<()> {
    std::fs::metadata(file).map_err(|error| Error::io(file, error))?;
    let given = std::env::var_os(PROGRAM);
    let program = given.clone().unwrap_or_else(|| "blender".into());
    let is_python = Path::new(&program).file_name().is_some_and(|name| name.to_string_lossy().starts_with("python"));
    let mut command = Command::new("sh");
    command.arg("-c").arg("exec \"$@\" 3>&1 1>&2").arg("sh").arg(&program);
    if is_python {
        let open = "import bpy, sys\nbpy.ops.wm.open_mainfile(filepath=sys.argv[1])\n";
        command.arg("-c").arg(format!("{open}{INSIDE}")).arg(file);
    } else {
        command.arg("-b").arg(file).args(["--python-exit-code", "1", "--python-expr", INSIDE]);
    }
    if !is_found(Path::new(&program)) {
        let shown = shown::path(Path::new(&program));
        let found = match given {
            Some(_) => format!("{PROGRAM} is {shown}, where there is no program"),
            None => format!("there is no program {shown} on the PATH to read {}", shown::path(file)),
        };
        let allowed = format!("{PROGRAM} with the path of Blender, or of a Python that has it as the module bpy");
        return Err(usage::wrong(anyhow!("scene.blend: {found}; allowed: {allowed}")));
    }
    let error = command.arg("--").args(arguments).exec();
    Err(anyhow!("cannot start {}: {error}", shown::path(Path::new(&program))))
}

/// Whether there is a program of this name or path.
fn is_found(program: &Path) -> bool {
    if program.components().count() > 1 {
        return program.is_file();
    }
    let folders = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&folders).any(|folder| folder.join(program).is_file())
}
