//! Runs that are interrupted, or whose files cannot be written: what they print and what they leave behind.

mod common;

use common::{command, files, stderr, stdout};
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// About 80,000 points.
const SCAN: &str = "scan HALL --sensor DIR/fine.yaml --at -6,6,1.2 -q";

/// Every way to write something.
const RUNS: &[&str] = &[
    "-o DIR/out/a.csv",
    "-o DIR/out/a.ply",
    "-o DIR/out/a.las",
    "-o DIR/out/a.x --format las2",
    "-o DIR/out/a.npz",
    "-o DIR/out/a.h5",
    "-o DIR/out/a.csv -o DIR/out/b.ply -o DIR/out/c.h5 --preview DIR/out/a.png",
    "--preview DIR/out/a.png --view perspective",
    "--frames 0:3 --single -o DIR/out/a.csv -o DIR/out/b.h5 --preview DIR/out/c.png",
    "PINGS --pings DIR/out/a.npz --image DIR/out/b.png --preview DIR/out/c.png --view waterfall -o DIR/out/d.csv",
    "PINGS --pings DIR/out/a.h5 --image DIR/out/b.npz --view waterfall",
    "LAKE",
];

/// The arguments of one of [`RUNS`].
fn arguments(run: &str) -> String {
    let lake = "generate seabed --seed 3 -q -o DIR/out/lake.glb";
    let pings = "scan DIR/lake.glb --sensor sss_900 --set range.max_m=15 --trajectory DIR/way.csv --frames 0:9 -q";
    match run.strip_prefix("PINGS") {
        Some(files) => format!("{pings}{files}"),
        None if run == "LAKE" => lake.to_owned(),
        None => format!("{SCAN} {run}"),
    }
}

/// Creates the inputs of the runs.
fn prepare(folder: &Path) {
    let pattern = "{type: raster, azimuth: {fov_deg: 350, step_deg: 0.4}, elevation: {fov_deg: 60, step_deg: 0.4}}";
    fs::write(folder.join("fine.yaml"), format!("name: fine\nkind: lidar\npattern: {pattern}\n")).unwrap();
    fs::write(folder.join("way.csv"), "time,x,y,z,qx,qy,qz,qw\n0,-8,0,-3,0,0,0,1\n9,8,0,-3,0,0,0,1\n").unwrap();
    stdout(folder, "generate seabed --size 20,20 --cell 0.5 -q -o DIR/lake.glb");
    fs::create_dir(folder.join("out")).unwrap();
}

/// The contents of each file of `folder`.
fn contents(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    files(folder).into_iter().map(|name| (name.clone(), fs::read(folder.join(name)).unwrap())).collect()
}

/// Starts a program that ignores no signal, whatever the process that runs the tests ignores (`nohup`, background
/// jobs).
fn start(program: &mut Command) -> Child {
    let mut start = Command::new("env");
    start.arg("--default-signal=HUP,INT,TERM").arg(program.get_program()).args(program.get_args());
    if let Some(folder) = program.get_current_dir() {
        start.current_dir(folder);
    }
    for (name, value) in program.get_envs() {
        match value {
            Some(value) => start.env(name, value),
            None => start.env_remove(name),
        };
    }
    start.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap()
}

fn signal(name: &str, process: u32) {
    // It may have ended meanwhile.
    Command::new("kill").args([&format!("-{name}"), &process.to_string()]).stderr(Stdio::null()).status().unwrap();
}

/// Any signal ends a program while its libraries are being loaded, before it has begun anything.
fn wait_until_it_listens(child: &Child) {
    /// SIGHUP, SIGINT, SIGTERM.
    const ALL: u64 = 0x4003;
    let caught = || {
        let status = fs::read_to_string(format!("/proc/{}/status", child.id())).ok()?;
        let mask = status.lines().find_map(|line| line.strip_prefix("SigCgt:"))?;
        u64::from_str_radix(mask.trim(), 16).ok()
    };
    // A program that has ended catches no signals, and must not be waited for in vain.
    let start = Instant::now();
    while caught().is_some_and(|mask| mask & ALL != ALL) && start.elapsed() < Duration::from_secs(60) {
        sleep(Duration::from_millis(1));
    }
}

const INTERRUPTED: &str = "error: interrupted; complete files stay, others are removed\n";

/// Interrupts at random moments; `ECHOCAST_INTERRUPTS` sets how many.
#[test]
fn interrupted_runs_leave_whole_files_and_no_others() {
    let count = std::env::var("ECHOCAST_INTERRUPTS").ok().map_or(24, |count| count.parse().expect("a number"));
    let folder = tempfile::tempdir().unwrap();
    prepare(folder.path());
    let out = folder.path().join("out");
    let whole: Vec<_> = RUNS
        .iter()
        .map(|run| {
            let start = Instant::now();
            stdout(folder.path(), &arguments(run));
            let (took, whole) = (start.elapsed(), contents(&out));
            whole.keys().for_each(|name| fs::remove_file(out.join(name)).unwrap());
            (took, whole)
        })
        .collect();
    let mut random = 1u64;
    let mut seen = [0, 0];
    for round in 0..count {
        let (run, (took, whole)) = (RUNS[round % RUNS.len()], &whole[round % RUNS.len()]);
        // Every other time there are older files.
        let old = (round / RUNS.len()).is_multiple_of(2);
        if old {
            whole.keys().for_each(|name| fs::write(out.join(name), "old").unwrap());
        }
        random = random.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        let part = (random >> 40) as f64 / (1u64 << 24) as f64;
        let child = start(&mut command(folder.path(), &arguments(run)));
        wait_until_it_listens(&child);
        sleep(took.mul_f64(part));
        signal(["INT", "TERM", "HUP"][round % 3], child.id());
        // Some users are impatient.
        if round % 5 == 4 {
            sleep(Duration::from_millis(3));
            signal("INT", child.id());
        }
        let output = child.wait_with_output().unwrap();
        let (status, said) = (output.status, stderr(&output));
        assert!(matches!(status.code(), Some(0 | 130)), "{run}: {status} {said}");
        assert!(said.is_empty() || said == INTERRUPTED, "{run}: {said}");
        seen[usize::from(status.code() == Some(130))] += 1;
        let left = contents(&out);
        for (name, bytes) in &left {
            let complete = whole.get(name) == Some(bytes);
            assert!(complete || old && whole.contains_key(name) && bytes == b"old", "{run}: {status}: {name}");
            assert!(complete || status.code() != Some(0), "{run}: {name}");
        }
        // Files that belong together are from one run.
        for (name, names) in [("a.csv", "a.labels.json"), ("b.ply", "b.labels.json"), ("b.png", "b.category_id.png")] {
            let of_today = |name| left.get(name).map(|bytes| bytes != b"old");
            assert!(
                !whole.contains_key(names) || !whole.contains_key(name) || of_today(name) == of_today(names),
                "{run}"
            );
        }
        assert!(!old || left.len() == whole.len(), "{run}: {:?}", left.keys());
        left.keys().for_each(|name| fs::remove_file(out.join(name)).unwrap());
    }
    println!("{count} interrupts: {} ended with 130, {} were too late", seen[1], seen[0]);
    assert!(seen[1] * 4 > count, "{seen:?}");
}

/// Starts a scan that is one piece of work of many seconds.
fn start_long_work(folder: &Path) -> Child {
    let pattern = "{type: raster, azimuth: {fov_deg: 350, step_deg: 0.1}, elevation: {fov_deg: 60, step_deg: 0.1}}";
    let beam = "{divergence_mrad: 3, sub_rays: 256, pulse_ns: 5}";
    fs::write(folder.join("long.yaml"), format!("name: l\nkind: lidar\npattern: {pattern}\nbeam: {beam}\n")).unwrap();
    fs::write(folder.join("a.npz"), "old").unwrap();
    let child = start(&mut command(folder, "scan HALL --sensor DIR/long.yaml --at -6,6,1.2 -q -o DIR/a.npz"));
    wait_until_it_listens(&child);
    sleep(Duration::from_millis(500));
    child
}

#[test]
fn work_that_does_not_check_is_ended_soon() {
    let folder = tempfile::tempdir().unwrap();
    let child = start_long_work(folder.path());
    let start = Instant::now();
    signal("INT", child.id());
    let output = child.wait_with_output().unwrap();
    let took = start.elapsed();
    // The work alone would take ten times as long.
    assert!(took < Duration::from_secs(15), "{took:?}");
    assert_eq!((output.status.code(), stderr(&output)), (Some(130), INTERRUPTED));
    assert_eq!(files(folder.path()), ["a.npz", "long.yaml"]);
    assert_eq!(fs::read(folder.path().join("a.npz")).unwrap(), b"old");
}

#[test]
fn a_second_interrupt_ends_at_once() {
    // After the first interrupt it waits for a second. A busy machine may take that long for anything, but not every
    // time.
    let is_soon = (0..5).any(|_| {
        let folder = tempfile::tempdir().unwrap();
        let child = start_long_work(folder.path());
        let start = Instant::now();
        signal("INT", child.id());
        sleep(Duration::from_millis(100));
        signal("TERM", child.id());
        let output = child.wait_with_output().unwrap();
        let took = start.elapsed();
        println!("{took:?}");
        assert_eq!(output.status.code(), Some(130));
        assert_eq!(files(folder.path()), ["a.npz", "long.yaml"]);
        took < Duration::from_millis(900)
    });
    assert!(is_soon);
}

#[test]
fn ignored_signals_stay_ignored() {
    let folder = tempfile::tempdir().unwrap();
    prepare(folder.path());
    for (ignored, sent) in [("HUP INT", ["HUP", "INT"]), ("TERM", ["TERM", "TERM"])] {
        let program = command(folder.path(), &format!("{SCAN} --frames 0:3 --single -o DIR/out/a.csv"));
        let mut ignoring = Command::new("sh");
        ignoring.args(["-c", &format!("trap '' {ignored}; exec \"$@\""), "sh"]);
        let child = start(ignoring.arg(program.get_program()).args(program.get_args()));
        while !folder.path().join("out/a_0000.csv").exists() {
            sleep(Duration::from_millis(5));
        }
        sent.iter().for_each(|name| signal(name, child.id()));
        let output = child.wait_with_output().unwrap();
        assert!(output.status.success(), "{}: {}", output.status, stderr(&output));
        assert_eq!(files(&folder.path().join("out")).len(), 8);
        fs::remove_dir_all(folder.path().join("out")).unwrap();
        fs::create_dir(folder.path().join("out")).unwrap();
    }
}

/// Whether `wrapper`, a command with its arguments, can run another here; prints a line if not.
fn can(wrapper: &[&str]) -> bool {
    let output = Command::new(wrapper[0]).args(&wrapper[1..]).arg("true").output();
    let can = output.as_ref().is_ok_and(|output| output.status.success());
    if !can {
        println!("skipped: {} is not possible here: {output:?}", wrapper.join(" "));
    }
    can
}

/// `command` as an argument of `wrapper`.
fn wrapped(wrapper: &[&str], command: &Command) -> Command {
    let mut outer = Command::new(wrapper[0]);
    outer.args(&wrapper[1..]).arg(command.get_program()).args(command.get_args());
    outer
}

/// Containers that share a folder may have processes with the same number.
#[test]
fn one_container_leaves_the_files_of_another_alone() {
    let space = ["unshare", "-pf", "--mount-proc"];
    if !can(&space) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    prepare(folder.path());
    // So many frames that both still write when the other is interrupted, however slow the machine.
    let scan = |name: &str| {
        let args = format!("{SCAN} --frames 0:9999 --single -o DIR/out/{name}.h5");
        start(&mut wrapped(&space, &command(folder.path(), &args)))
    };
    let (mut one, other) = (scan("one"), scan("other"));
    let unfinished = || files(&folder.path().join("out")).len();
    let begin = Instant::now();
    while unfinished() < 2 && begin.elapsed() < Duration::from_secs(300) {
        sleep(Duration::from_millis(2));
    }
    assert_eq!(unfinished(), 2, "both write");
    // The program is the child of the process that has created its namespace.
    let interrupt = |outer: &Child| {
        let child = fs::read_to_string(format!("/proc/{0}/task/{0}/children", outer.id())).unwrap();
        signal("INT", child.trim().parse().expect("one child"));
    };
    interrupt(&other);
    assert_eq!(stderr(&other.wait_with_output().unwrap()), INTERRUPTED);
    assert!(one.try_wait().unwrap().is_none() && unfinished() == 1, "the file of the one that still runs stays");
    interrupt(&one);
    assert_eq!(stderr(&one.wait_with_output().unwrap()), INTERRUPTED);
    assert_eq!(unfinished(), 0);
}

/// The cloud cannot get its name: the old label names stay, too.
#[test]
fn an_error_leaves_the_old_pair() {
    let inject = "inject=rename,renameat,renameat2:error=EIO:when=2";
    let strace = ["strace", "-qq", "-o", "/dev/null", "-e", "trace=rename,renameat,renameat2", "-e", inject];
    if !can(&strace) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    for name in ["a.ply", "a.labels.json"] {
        fs::write(folder.path().join(name), "old").unwrap();
    }
    let scan = command(folder.path(), "scan HALL --sensor velodyne_vlp16 --at -6,6,1.2 -q -o DIR/a.ply");
    let output = wrapped(&strace, &scan).output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", stderr(&output));
    assert!(stderr(&output).ends_with("a.ply: Input/output error (os error 5)\n"), "{}", stderr(&output));
    let left = contents(folder.path());
    assert!(left.len() == 2 && left.values().all(|bytes| bytes == b"old"), "{:?}", left.keys());
}

/// One sentence, whatever the messages of the libraries that write.
#[test]
fn a_full_disk_is_one_sentence() {
    let space = ["unshare", "-m"];
    if !can(&space) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    prepare(folder.path());
    let on_full_disk = |args: &str| -> Output {
        let mount = "mount -t tmpfs -o size=128k full \"$0\" || exit 99; \"$@\"; code=$?; ls -A \"$0\"; exit $code";
        let program = command(folder.path(), args);
        let mut shell = Command::new("sh");
        shell.args(["-c", mount]).arg(folder.path().join("out")).arg(program.get_program()).args(program.get_args());
        wrapped(&space, &shell).output().unwrap()
    };
    for run in RUNS {
        let output = on_full_disk(&arguments(run));
        if output.status.code() == Some(99) {
            println!("skipped: no disk can be mounted here: {}", stderr(&output));
            return;
        }
        let said = stderr(&output);
        let sentence = said.starts_with("error: ") && said.ends_with(": No space left on device (os error 28)\n");
        assert!(output.status.code() == Some(1) && sentence && said.lines().count() == 1, "{run}: {said}");
        let left = String::from_utf8(output.stdout).unwrap();
        assert!(!left.contains(".echocast"), "{run}: {left}");
    }
}

/// Like a full disk, on every system: files may not grow beyond a limit.
#[test]
fn a_file_that_may_not_grow_is_one_sentence() {
    let folder = tempfile::tempdir().unwrap();
    prepare(folder.path());
    let few = "scan HALL --sensor velodyne_vlp16 --at -6,6,1.2 -q";
    let more = [
        format!("{few} --boxes DIR/out/a.json"),
        format!("{few} --boxes DIR/out/a.csv"),
        "info HALL --preview DIR/out/a.png".to_owned(),
    ];
    for args in RUNS.iter().map(|run| arguments(run)).chain(more) {
        // Room for nothing at all, and for a part of most files.
        for blocks in [0, 1] {
            let program = command(folder.path(), &args);
            let mut limited = Command::new("sh");
            limited.args(["-c", "ulimit -c 0; ulimit -f \"$0\"; exec \"$@\"", &blocks.to_string()]);
            let output = limited.arg(program.get_program()).args(program.get_args()).output().unwrap();
            let said = stderr(&output);
            let sentence = said.starts_with("error: ") && said.ends_with(": File too large (os error 27)\n");
            assert!(output.status.code() == Some(1) && sentence && said.lines().count() == 1, "{args}: {said}");
            assert_eq!(files(&folder.path().join("out")), Vec::<String>::new(), "{args}");
        }
    }
}
