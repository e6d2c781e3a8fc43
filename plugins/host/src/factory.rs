//! How are renderers of a plugin made? The library is opened for the first one.

use crate::call::LogLine;
use crate::callee::{Callee, Local};
use crate::library::open;
use crate::limits::Limits;
use crate::manifest::Manifest;
use crate::refusal::Refusal;
use crate::renderer::{Described, PluginRenderer};
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::Framebuffer;
use polyptych_core::scene::Scene;
use polyptych_core::seam::{
    BackendFactory, BackendInfo, Control, Frame, Need, Plan, Prepared, Registry, RenderError, Renderer,
    Report,
};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Where plugins are run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Isolation {
    /// In this process: fast, and for libraries that are trusted. A crash ends the program.
    InProcess,
    /// In a process of its own for each renderer, so that nothing a plugin does ends this one. The program is started
    /// for that; it must call [`crate::serve`] first of all. Linux only.
    Child {
        /// What is started: this program, or `polyptych`.
        program: PathBuf,
    },
}

/// How plugins are run.
#[derive(Clone)]
pub struct Options {
    /// Where lines of their logs go.
    pub log: Arc<dyn Fn(LogLine) + Send + Sync>,
    /// Where they are run.
    pub isolation: Isolation,
    /// How long one in a child may do what.
    pub limits: Limits,
}

/// Tells that this program serves plugins if it is started for that.
static SERVES: AtomicBool = AtomicBool::new(false);

/// Lets this program run plugins in processes of their own. To be called first of all in `main`: where the program was
/// started as such a process, it serves the plugin and does not return.
pub fn serve() {
    #[cfg(target_os = "linux")]
    {
        crate::child::serve();
        SERVES.store(true, Ordering::Release);
    }
}

impl Default for Options {
    /// Runs plugins in processes of their own where this program called [`serve`], else in this process.
    fn default() -> Self {
        let program = std::env::current_exe().ok().filter(|_| SERVES.load(Ordering::Acquire));
        let isolation = program.map_or(Isolation::InProcess, |program| Isolation::Child { program });
        Self { log: Arc::new(|_| {}), isolation, limits: Limits::default() }
    }
}

/// Makes renderers of a plugin.
pub struct PluginFactory {
    info: BackendInfo,
    library: PathBuf,
    manifest: Option<Manifest>,
    options: Options,
}

impl PluginFactory {
    /// Makes a factory of a plugin that was found with a manifest. Its library is opened when it is needed.
    #[must_use]
    pub fn listed(library: PathBuf, manifest: Manifest, options: &Options) -> Self {
        Self { info: manifest.info(), library, manifest: Some(manifest), options: options.clone() }
    }

    /// Makes a factory of a library that was named, and opens it.
    ///
    /// # Errors
    /// Says in one line why the library is refused.
    pub fn named(library: &Path, options: &Options) -> Result<Self, Refusal> {
        let info = match &options.isolation {
            Isolation::InProcess => open(library)?.info.clone(),
            #[cfg(target_os = "linux")]
            Isolation::Child { program } => crate::child::describe(program, library)?.info(),
            #[cfg(not(target_os = "linux"))]
            Isolation::Child { .. } => return Err(no_child(library)),
        };
        Ok(Self { info, library: library.into(), manifest: None, options: options.clone() })
    }

    fn renderer(&self) -> Result<PluginRenderer, Refusal> {
        let log = self.options.log.clone();
        let (said, plans, callee): (Manifest, bool, Box<dyn Callee>) = match &self.options.isolation {
            Isolation::InProcess => {
                let loaded = open(&self.library)?;
                let plans = loaded.table.plan.is_some();
                (Manifest::of(loaded), plans, Box::new(Local::new(loaded, log)))
            }
            #[cfg(target_os = "linux")]
            Isolation::Child { program } => {
                let (peer, manifest, plans) =
                    crate::child::Peer::start(program, &self.library, self.options.limits, log)?;
                (manifest, plans, Box::new(peer))
            }
            #[cfg(not(target_os = "linux"))]
            Isolation::Child { .. } => return Err(no_child(&self.library)),
        };
        if let Some(what) = self.manifest.as_ref().and_then(|m| m.differs_from(&said)) {
            return Err(Refusal::OtherThanManifest { path: self.library.clone(), what });
        }
        let described = Described { info: said.info(), accepts: said.accepts, plans };
        Ok(PluginRenderer::new(described, callee))
    }
}

#[cfg(not(target_os = "linux"))]
fn no_child(library: &Path) -> Refusal {
    let what = "this system lacks it: trust the plugin, and run it in this process".to_owned();
    Refusal::NoChild { path: library.into(), what }
}

impl BackendFactory for PluginFactory {
    fn info(&self) -> BackendInfo {
        self.info.clone()
    }

    fn create(&self, _: &Registry) -> Box<dyn Renderer> {
        match self.renderer() {
            Ok(renderer) => Box::new(renderer),
            Err(refusal) => Box::new(Refused { info: self.info.clone(), why: refusal.to_string() }),
        }
    }
}

/// Stands in for a library that was refused when it was opened.
struct Refused {
    info: BackendInfo,
    why: String,
}

impl Renderer for Refused {
    fn info(&self) -> &BackendInfo {
        &self.info
    }

    fn plan(&self, _: &Scene, _: &Need) -> Plan {
        Plan::default()
    }

    fn prepare(
        &mut self,
        _: &Arc<Scene>,
        _: &Need,
        _: &Converter,
        _: &Control<'_>,
    ) -> Result<Prepared, RenderError> {
        Err(RenderError::Failed(self.why.clone()))
    }

    fn render(&mut self, _: &Frame, _: &mut Framebuffer, _: &Control<'_>) -> Result<Report, RenderError> {
        Err(RenderError::Failed(self.why.clone()))
    }
}
