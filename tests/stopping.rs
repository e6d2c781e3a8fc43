//! Does work that is stopped anywhere leave nothing half made behind?

use polyptych::builtin;
use polyptych::convert::Converter;
use polyptych::parallel::OneThread;
use polyptych::prelude::*;
use polyptych::seam::{Control, Probe, RenderError};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

/// Lets the work ask so many times whether to go on, then stops it.
struct After(AtomicU64);

impl After {
    fn times(count: u64) -> Self {
        Self(AtomicU64::new(count))
    }
}

impl Probe for After {
    fn stops(&self) -> bool {
        self.0.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(1)).is_err()
    }
}

/// Returns how often some work asks whether to go on.
fn asks(work: impl FnOnce(&Control<'_>)) -> u64 {
    let probe = After::times(u64::MAX);
    work(&Control::new(&OneThread).probed_by(&probe));
    u64::MAX - probe.0.into_inner()
}

/// Lists times after which to stop work that asks so often: the first few, then ever rarer ones, and the last.
fn stops(asks: u64) -> Vec<u64> {
    let mut times: Vec<u64> = (0..2).chain((0..6).map(|k| 5 * 8u64.pow(k))).filter(|k| *k < asks).collect();
    times.extend(asks.checked_sub(1));
    times.dedup();
    times
}

#[test]
fn what_was_stopped_anywhere_is_whole_the_next_time() {
    let (scene, registry) = (Arc::new(builtin::scene("atelier").unwrap()), Registry::builtin());
    for backend in ["reference", "raster", "voxel", "freeform", "stylized"] {
        let create = || registry.create(backend).unwrap();
        let channels = create().info().channels;
        let need = Need { channels, ..Need::new(scene.cameras[0].1.clone(), 72, 48) };
        let picture = || Framebuffer::new(need.width, need.height, channels);
        let simple = Control::simple();
        let (mut fresh, mut whole) = (create(), picture());
        fresh.prepare(&scene, &need, &Converter::default(), &simple).unwrap();
        fresh.render(&need.frame(), &mut whole, &simple).unwrap();

        let preparing = asks(|control| {
            create().prepare(&scene, &need, &Converter::default(), control).unwrap();
        });
        let (mut renderer, mut target) = (create(), picture());
        for times in stops(preparing) {
            let (probe, converter) = (After::times(times), Converter::default());
            let stopped = Control::new(&OneThread).probed_by(&probe);
            let error = renderer.prepare(&scene, &need, &converter, &stopped).err();
            assert_eq!(
                error,
                Some(RenderError::Cancelled),
                "{backend}: preparing, after {times} of {preparing}"
            );
            renderer.prepare(&scene, &need, &converter, &simple).unwrap();
            renderer.render(&need.frame(), &mut target, &simple).unwrap();
            assert!(target.same_bits(&whole), "{backend}: preparing, after {times} of {preparing}");
            renderer = create();
        }

        renderer.prepare(&scene, &need, &Converter::default(), &simple).unwrap();
        let drawing = asks(|control| {
            renderer.render(&need.frame(), &mut target, control).unwrap();
        });
        for times in stops(drawing) {
            let probe = After::times(times);
            let stopped = Control::new(&OneThread).probed_by(&probe);
            target.touch();
            let error = renderer.render(&need.frame(), &mut target, &stopped).err();
            assert_eq!(error, Some(RenderError::Cancelled), "{backend}: drawing, after {times} of {drawing}");
            target.touch();
            renderer.render(&need.frame(), &mut target, &simple).unwrap();
            assert!(target.same_bits(&whole), "{backend}: drawing, after {times} of {drawing}");
        }
        println!("{backend}: asks {preparing} times while preparing, {drawing} while drawing");
    }
}
