//! How do the examples draw and save a picture?

use polyptych_core::camera::Camera;
use polyptych_core::convert::Converter;
use polyptych_core::framebuffer::{Channels, Framebuffer};
use polyptych_core::metrics::display_colors;
use polyptych_core::parallel::Pool;
use polyptych_core::scene::Scene;
use polyptych_core::seam::{Control, Need, Renderer};
use polyptych_freeform::Freeform;
use std::error::Error;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// A scene, ready to be drawn into a folder.
pub(crate) struct Easel {
    scene: Arc<Scene>,
    freeform: Freeform,
    pool: Pool,
    folder: PathBuf,
    settings: Vec<(&'static str, &'static str)>,
}

impl Easel {
    /// Takes a scene, the folder for its pictures, and settings of the back end.
    pub(crate) fn new(
        scene: Scene,
        folder: PathBuf,
        settings: &[(&'static str, &'static str)],
    ) -> Result<Self, Box<dyn Error>> {
        std::fs::create_dir_all(&folder)?;
        let pool = Pool::new(std::thread::available_parallelism()?.get())?;
        let (scene, settings) = (Arc::new(scene), settings.to_vec());
        Ok(Self { scene, freeform: Freeform::new(), pool, folder, settings })
    }

    /// Draws a picture, saves it, and tells the median time of five frames.
    pub(crate) fn draw(
        &mut self,
        name: &str,
        camera: Camera,
        [width, height]: [u32; 2],
    ) -> Result<(), Box<dyn Error>> {
        let mut need = Need::new(camera, width, height);
        need.channels = Channels::COLOR;
        let declared = self.freeform.info().parameters.clone();
        for (name, value) in &self.settings {
            need.settings.set("freeform", &declared, name, value)?;
        }
        let control = Control::new(&self.pool);
        self.freeform.prepare(&self.scene, &need, &Converter::default(), &control)?;
        let mut picture = Framebuffer::new(width, height, need.channels);
        let mut times = Vec::new();
        for _ in 0..5 {
            picture.touch();
            let start = Instant::now();
            self.freeform.render(&need.frame(), &mut picture, &control)?;
            times.push(start.elapsed());
        }
        times.sort_unstable();
        let path = self.folder.join(format!("{name}.png"));
        let bytes = display_colors(&picture).into_iter().flatten();
        let bytes = bytes.map(|c| (c.clamp(0.0, 1.0) * 255.0).round() as u8).collect();
        image::RgbImage::from_raw(width, height, bytes).ok_or("a picture of another size")?.save(&path)?;
        println!("{}: {:.1} ms", path.display(), times[2].as_secs_f64() * 1e3);
        Ok(())
    }
}

/// Returns the folder that was named, and the file, if one was.
pub(crate) fn arguments() -> Result<(PathBuf, Option<PathBuf>), Box<dyn Error>> {
    let mut words = std::env::args_os().skip(1).map(PathBuf::from);
    Ok((words.next().ok_or("name a folder for the pictures")?, words.next()))
}
