//! What the command line looks like.

use clap::{Args, Parser, Subcommand, ValueEnum};
use polyptych::convert::Filling;
use polyptych::framebuffer::Channel;
use std::path::PathBuf;

/// Renders one scene through several back ends, side by side, and tells how fast and how right each one is.
#[derive(Parser, Debug)]
#[command(name = "polyptych", version, about, disable_help_subcommand = true)]
pub(super) struct Arguments {
    #[command(subcommand)]
    pub(super) command: Option<Command>,
}

#[derive(Subcommand, Debug)]
pub(super) enum Command {
    /// Draw one picture.
    Render(RenderArguments),
    /// Draw a scene with every back end beside the reference, with times and errors (the default).
    Compare(CompareArguments),
    /// Chart error against time: every back end along its quality axes, over scenes.
    Chart(ChartArguments),
    /// Sweep each way in which methods fail until they do; ends with code 4 where something got worse.
    Stability(StabilityArguments),
    /// Tell what each back end would build and why; builds nothing.
    Plan(PlanArguments),
    /// Time frames.
    Bench(BenchArguments),
    /// Draw the frames of a turntable, or of a flight through a scene's cameras.
    Animate(AnimateArguments),
    /// Convert a scene into a model of triangles, voxels or distances.
    Convert(ConvertArguments),
    /// List the back ends with what they draw and their parameters.
    Backends(BackendsArguments),
    /// Check a plugin against everything that back ends promise; ends with code 4 where a promise is not kept.
    Validate(ValidateArguments),
    /// Open the viewer: back ends side by side, live.
    View(ViewerArguments),
}

#[derive(Args, Debug)]
pub(super) struct ViewerArguments {
    /// Scene file, model, or builtin:NAME.
    #[arg(default_value = "builtin:atelier")]
    pub(super) scene: String,
    /// Folder with plugins, besides those of POLYPTYCH_PLUGIN_PATH and the user's own.
    #[arg(long, value_name = "DIR")]
    pub(super) plugin_dir: Vec<PathBuf>,
    /// Run plugins in the viewer's process instead of processes of their own: for those that are trusted.
    #[arg(long)]
    pub(super) trust_plugins: bool,
}

#[derive(Args, Debug)]
pub(super) struct RenderArguments {
    #[command(flatten)]
    pub(super) scene: SceneArguments,
    #[command(flatten)]
    pub(super) draw: DrawArguments,
    /// File to write: .png, .jpg, .exr or .pfm; .svg for the lines of `stylized`; `-` draws in the terminal.
    #[arg(short, long, value_name = "FILE")]
    pub(super) output: PathBuf,
    /// Channel to write.
    #[arg(long, default_value = "color", value_parser = channel)]
    pub(super) channel: Channel,
}

#[derive(Args, Debug, Default)]
pub(super) struct CompareArguments {
    #[command(flatten)]
    pub(super) scene: SceneArguments,
    #[command(flatten)]
    pub(super) draw: DrawArguments,
    /// Folder to write to.
    #[arg(short, long, value_name = "DIR", default_value = "out/compare")]
    pub(super) output: Option<PathBuf>,
    /// End with code 4 unless every picture passes its gate.
    #[arg(long)]
    pub(super) gate: bool,
}

#[derive(Args, Debug)]
pub(super) struct ChartArguments {
    /// Scenes: files or builtin:NAME; all built-in ones when none is given.
    #[arg(value_name = "SCENE")]
    pub(super) scenes: Vec<String>,
    #[command(flatten)]
    pub(super) reading: ReadingArguments,
    #[command(flatten)]
    pub(super) draw: DrawArguments,
    /// Folder to write to. A chart that was stopped goes on when it is started again with the same words.
    #[arg(short, long, value_name = "DIR", default_value = "out/chart")]
    pub(super) output: PathBuf,
    /// Leave out how cost grows with triangles, voxels, functions, lights, pixels and threads.
    #[arg(long)]
    pub(super) no_growth: bool,
}

#[derive(Args, Debug)]
pub(super) struct StabilityArguments {
    /// Cases; all when none is given.
    #[arg(value_name = "CASE")]
    pub(super) cases: Vec<String>,
    /// Back ends, separated by commas.
    #[arg(short, long, value_name = "ID", value_delimiter = ',')]
    pub(super) backend: Vec<String>,
    /// Folder to write to.
    #[arg(short, long, value_name = "DIR", default_value = "out/stability")]
    pub(super) output: PathBuf,
    /// End with code 4 where something breaks earlier than this file says.
    #[arg(long, value_name = "LIMITS.md")]
    pub(super) check: Option<PathBuf>,
    /// Draw one value of a case, and tell its error and its worst pixel.
    #[arg(long, value_name = "VALUE", allow_hyphen_values = true)]
    pub(super) at: Option<f64>,
    /// With --at: take the better way.
    #[arg(long, requires = "at")]
    pub(super) better: bool,
    /// With --at: tell about this pixel instead of the worst.
    #[arg(long, value_name = "X,Y", requires = "at", value_parser = pixel)]
    pub(super) pixel: Option<[u32; 2]>,
    /// Threads; 0 = one for each core.
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u16).range(0..=1024))]
    pub(super) threads: u16,
    #[command(flatten)]
    pub(super) plugins: PluginArguments,
    /// Print the outcomes as JSON, and nothing else, on standard output.
    #[arg(long)]
    pub(super) json: bool,
    /// Print no table.
    #[arg(short, long)]
    pub(super) quiet: bool,
}

#[derive(Args, Debug)]
pub(super) struct PlanArguments {
    #[command(flatten)]
    pub(super) scene: SceneArguments,
    #[command(flatten)]
    pub(super) draw: DrawArguments,
}

#[derive(Args, Debug)]
pub(super) struct BenchArguments {
    #[command(flatten)]
    pub(super) scene: SceneArguments,
    #[command(flatten)]
    pub(super) draw: DrawArguments,
    /// Frames to time.
    #[arg(long, default_value_t = 9, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub(super) frames: u32,
    /// Frames to draw before.
    #[arg(long, default_value_t = 2)]
    pub(super) warmup: u32,
    /// Move the camera around the scene with every frame.
    #[arg(long)]
    pub(super) orbit: bool,
}

#[derive(Args, Debug)]
pub(super) struct AnimateArguments {
    #[command(flatten)]
    pub(super) scene: SceneArguments,
    #[command(flatten)]
    pub(super) draw: DrawArguments,
    /// Folder for the frames, or a .gif or .apng. Frames that are there already are not drawn again.
    #[arg(short, long, value_name = "DIR|FILE", default_value = "out/animate")]
    pub(super) output: PathBuf,
    /// Turn the camera once around the scene; otherwise it flies through the scene's cameras.
    #[arg(long)]
    pub(super) turntable: bool,
    /// Draw these frames: from A up to, but without, B.
    #[arg(long, value_name = "A..B", value_parser = frames)]
    pub(super) frames: Option<[u32; 2]>,
    /// Frames of the whole animation (the end of --frames, or 120).
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub(super) count: Option<u32>,
    /// Draw each N-th frame only, beginning with the K-th: one of N processes that share the work.
    #[arg(long, value_name = "K/N", value_parser = shard)]
    pub(super) shard: Option<[u32; 2]>,
    /// Frames a second of a .gif or .apng.
    #[arg(long, default_value_t = 25, value_parser = clap::value_parser!(u16).range(1..=100))]
    pub(super) fps: u16,
}

#[derive(Args, Debug)]
pub(super) struct ConvertArguments {
    /// Scene file, model, volume, height map, or builtin:NAME.
    #[arg(value_name = "IN")]
    pub(super) input: String,
    /// File to write: .obj, .glb, .vox or .nrrd.
    #[arg(value_name = "OUT")]
    pub(super) output: PathBuf,
    #[command(flatten)]
    pub(super) reading: ReadingArguments,
    /// Representation; must fit the file.
    #[arg(long)]
    pub(super) to: Option<Representation>,
    /// Cells along the longest edge.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=2048), conflicts_with = "tolerance")]
    pub(super) resolution: Option<u32>,
    /// Greatest distance between the surfaces, meters.
    #[arg(long)]
    pub(super) tolerance: Option<f64>,
    /// Which cells are filled in a .vox file: those that the surface touches (`surface`, `natural`), as few as stop water
    /// over faces (`thin`), or all whose middle is inside (`solid`).
    #[arg(long, value_name = "natural|surface|thin|solid", value_parser = filling)]
    pub(super) filling: Option<Filling>,
    /// Threads; 0 = one for each core.
    #[arg(long, default_value_t = 0)]
    pub(super) threads: usize,
    /// Print the result as JSON.
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Args, Debug)]
pub(super) struct BackendsArguments {
    #[command(flatten)]
    pub(super) plugins: PluginArguments,
    /// Print the manifest of a library, to be put beside it. This runs the library's code.
    #[arg(long, value_name = "LIBRARY")]
    pub(super) manifest: Option<PathBuf>,
    /// Print the list as JSON.
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Args, Debug)]
pub(super) struct ValidateArguments {
    /// The plugin's library. This runs its code.
    #[arg(value_name = "PLUGIN")]
    pub(super) plugin: PathBuf,
    /// Folder to write report.html and report.json to.
    #[arg(short, long, value_name = "DIR", default_value = "out/validate")]
    pub(super) output: PathBuf,
    /// Run these checks only, in this process.
    #[arg(long, value_name = "CHECK", value_delimiter = ',')]
    pub(super) only: Vec<String>,
    /// Seed of what is random.
    #[arg(long, default_value_t = 1)]
    pub(super) seed: u64,
    /// End a check that takes so long.
    #[arg(long, value_name = "SECONDS", default_value_t = 120, value_parser = clap::value_parser!(u64).range(1..=86_400))]
    pub(super) timeout: u64,
    /// Run the plugin in the process of each check instead of one of its own.
    #[arg(long)]
    pub(super) trust_plugins: bool,
    /// Print the report as JSON, and nothing else, on standard output.
    #[arg(long)]
    pub(super) json: bool,
}

/// Where back ends in libraries are looked for.
#[derive(Args, Debug, Default)]
pub(super) struct PluginArguments {
    /// Folder with plugins, besides those of POLYPTYCH_PLUGIN_PATH and the user's own.
    #[arg(long, value_name = "DIR")]
    pub(super) plugin_dir: Vec<PathBuf>,
    /// Run plugins in this process instead of processes of their own: for those that are trusted.
    #[arg(long)]
    pub(super) trust_plugins: bool,
    /// End a plugin that gives no sign of progress for so long (30 s).
    #[arg(long, value_name = "SECONDS", value_parser = clap::value_parser!(u64).range(1..=86_400))]
    pub(super) plugin_limit: Option<u64>,
}

/// Representations that `convert` writes.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Representation {
    Mesh,
    Voxels,
    Volume,
}

/// Which scene.
#[derive(Args, Debug, Default)]
pub(super) struct SceneArguments {
    /// Scene file, model, volume, height map, or builtin:NAME.
    #[arg(value_name = "SCENE", default_value = "builtin:atelier")]
    pub(super) scene: Option<String>,
    #[command(flatten)]
    pub(super) reading: ReadingArguments,
}

/// What a file without a clear meaning holds.
#[derive(Args, Debug, Default)]
pub(super) struct ReadingArguments {
    /// Size and number format of a .raw volume.
    #[arg(long, value_name = "WxHxD:u8|u16|i16|f32")]
    pub(super) volume: Option<String>,
    /// Read a picture as a height map.
    #[arg(long)]
    pub(super) height_map: bool,
    /// Which frame of an animated .vox file is shown, counted from 0.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(super) frame: u32,
}

/// How to draw: shared by all commands that draw.
#[derive(Args, Debug, Default)]
pub(super) struct DrawArguments {
    /// Back ends, separated by commas; `auto` chooses one (render, compare, bench).
    #[arg(short, long, value_name = "ID", value_delimiter = ',')]
    pub(super) backend: Vec<String>,
    /// For `auto`: the greatest color error (root mean square, full scale 1); the fastest that meets it is taken.
    #[arg(long, value_name = "E")]
    pub(super) max_error: Option<f64>,
    /// For `auto`: the longest time of a frame; the most accurate that meets it is taken.
    #[arg(long, value_name = "MS")]
    pub(super) budget_ms: Option<f64>,
    /// Size of the picture.
    #[arg(long, value_name = "WxH", value_parser = size)]
    pub(super) size: Option<[u32; 2]>,
    /// Threads; 0 = one for each core.
    #[arg(long, value_parser = clap::value_parser!(u16).range(0..=1024))]
    pub(super) threads: Option<u16>,
    /// Set a parameter: key=value, or backend.key=value for one of several.
    #[arg(long, value_name = "KEY=VALUE")]
    pub(super) set: Vec<String>,
    /// Tolerance and samples together.
    #[arg(long)]
    pub(super) quality: Option<Quality>,
    /// How far an edge may be off, pixels.
    #[arg(long, value_name = "PX")]
    pub(super) tolerance: Option<f64>,
    /// Samples a pixel.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=256))]
    pub(super) samples: Option<u32>,
    #[command(flatten)]
    pub(super) plugins: PluginArguments,
    #[command(flatten)]
    pub(super) view: ViewArguments,
    /// Print the result as JSON, and nothing else, on standard output.
    #[arg(long)]
    pub(super) json: bool,
    /// Print no table.
    #[arg(short, long)]
    pub(super) quiet: bool,
    /// Print what was noted while loading, and how each object was drawn.
    #[arg(short, long)]
    pub(super) verbose: bool,
}

/// From where.
#[derive(Args, Debug, Default)]
pub(super) struct ViewArguments {
    /// A camera of the scene.
    #[arg(long, value_name = "NAME", conflicts_with_all = ["view", "eye"])]
    pub(super) camera: Option<String>,
    /// Direction from which the whole scene is framed, degrees.
    #[arg(long, value_name = "AZIMUTH,ELEVATION", value_parser = numbers::<2>, allow_hyphen_values = true, conflicts_with = "eye")]
    pub(super) view: Option<[f64; 2]>,
    /// Position of the eye.
    #[arg(long, value_name = "X,Y,Z", value_parser = numbers::<3>, allow_hyphen_values = true)]
    pub(super) eye: Option<[f64; 3]>,
    /// Point to look at.
    #[arg(long, value_name = "X,Y,Z", value_parser = numbers::<3>, allow_hyphen_values = true, requires = "eye")]
    pub(super) target: Option<[f64; 3]>,
    /// What is up in the picture.
    #[arg(long, value_name = "X,Y,Z", value_parser = numbers::<3>, allow_hyphen_values = true, requires = "eye")]
    pub(super) up: Option<[f64; 3]>,
    /// Field of view, degrees.
    #[arg(long, value_name = "DEGREES")]
    pub(super) fov: Option<f64>,
    /// How directions become pixels.
    #[arg(long)]
    pub(super) projection: Option<ProjectionName>,
}

/// Presets of tolerance and samples.
#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Quality {
    /// 2 px, 1 sample.
    Draft,
    /// 0.5 px, 1 sample.
    Normal,
    /// 0.25 px, 4 samples.
    High,
    /// 0.05 px, 16 samples.
    Exact,
}

#[derive(ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ProjectionName {
    Perspective,
    Orthographic,
    Fisheye,
    Cylindrical,
}

fn channel(text: &str) -> Result<Channel, String> {
    let names: Vec<_> = Channel::ALL.iter().map(|c| c.name()).collect();
    Channel::ALL
        .into_iter()
        .find(|c| c.name() == text)
        .ok_or_else(|| format!("use one of {}", names.join(", ")))
}

fn filling(text: &str) -> Result<Filling, String> {
    Filling::of_name(text).ok_or_else(|| format!("use one of {}", Filling::NAMES.join(", ")))
}

fn size(text: &str) -> Result<[u32; 2], String> {
    let refuse = || "write WIDTHxHEIGHT with numbers from 1 to 16384".to_owned();
    let (width, height) = text.split_once('x').ok_or_else(refuse)?;
    let parse = |s: &str| s.parse().ok().filter(|n| (1..=16_384).contains(n)).ok_or_else(refuse);
    Ok([parse(width)?, parse(height)?])
}

fn frames(text: &str) -> Result<[u32; 2], String> {
    let refuse = || "write A..B with whole numbers, A less than B, B at most 100000".to_owned();
    let (first, end) = text.split_once("..").ok_or_else(refuse)?;
    let [first, end]: [u32; 2] = [first.parse().map_err(|_| refuse())?, end.parse().map_err(|_| refuse())?];
    if first < end && end <= 100_000 { Ok([first, end]) } else { Err(refuse()) }
}

fn shard(text: &str) -> Result<[u32; 2], String> {
    let refuse = || "write K/N with whole numbers, K from 1 to N".to_owned();
    let (shard, shards) = text.split_once('/').ok_or_else(refuse)?;
    let [shard, shards]: [u32; 2] =
        [shard.parse().map_err(|_| refuse())?, shards.parse().map_err(|_| refuse())?];
    if (1..=shards).contains(&shard) { Ok([shard, shards]) } else { Err(refuse()) }
}

fn pixel(text: &str) -> Result<[u32; 2], String> {
    let refuse = || "write X,Y with whole numbers".to_owned();
    let (x, y) = text.split_once(',').ok_or_else(refuse)?;
    Ok([x.trim().parse().map_err(|_| refuse())?, y.trim().parse().map_err(|_| refuse())?])
}

fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let parsed: Vec<f64> =
        text.split(',').filter_map(|s| s.trim().parse().ok()).filter(|v: &f64| v.is_finite()).collect();
    let count = text.split(',').count();
    parsed
        .try_into()
        .ok()
        .filter(|_| count == N)
        .ok_or_else(|| format!("write {N} numbers separated by commas"))
}
