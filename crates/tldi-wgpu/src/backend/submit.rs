//! One submission: what it uploads, its dispatches, and what it reads back.

use super::WgpuBackend;
use crate::GpuError;
use crate::answer::Answer;
use crate::layout::{BatchData, CONTACT_WORDS, COUNTERS, GROUP, PAIR_WORDS};
use crate::measure::timer::Timer;
use crate::pipelines::{Pipeline, direct, is_needed};
use std::ops::Range;
use tldi_shaders::FURTHER_FROM;
use tldi_shaders::numbers::{IMAGE_GROUPS, PIXEL_GROUPS, TILE_GROUPS};
use wgpu::SubmissionIndex;

/// What was submitted and has not come back.
#[derive(Debug)]
pub(super) struct Asked {
    pub(super) submission: SubmissionIndex,
    pub(super) answer: Answer,
    /// Of the timestamps.
    pub(super) times: Option<Answer>,
    /// How many contacts come back.
    pub(super) contacts: u32,
}

/// Which of the stages a submission runs.
#[derive(Clone, Copy, PartialEq)]
enum Round {
    /// All but `further`: the views that `aim` chose.
    First,
    /// From `further` on: views that the first ones proved wanting.
    Further,
}

impl WgpuBackend {
    /// Uploads and submits the part.
    pub(super) fn submit(&mut self) -> Result<(), GpuError> {
        let data = self.upload.batch_data(&self.capacities)?;
        self.buffers.fit(&self.gpu, &data, &self.upload)?;
        self.bind();
        let mut encoder = (self.gpu.device).create_command_encoder(&Default::default());
        (self.sources).encode(&self.gpu, &mut encoder, self.resident.points())?;
        self.clear(&mut encoder, 0, &data);
        self.dispatch(&mut encoder, Round::First, &data);
        let contacts = self.expected_contacts.min(data.contacts);
        self.ask(encoder, 0..contacts, true)
    }

    /// Submits the views that the first ones proved wanting. Those before `contacts` have come back.
    pub(super) fn submit_further(&mut self, contacts: Range<u32>) -> Result<(), GpuError> {
        let data = self.upload.batch_data(&self.capacities)?;
        let mut encoder = (self.gpu.device).create_command_encoder(&Default::default());
        self.clear(&mut encoder, data.views_at, &data);
        self.dispatch(&mut encoder, Round::Further, &data);
        self.ask(encoder, contacts, true)
    }

    /// Submits the copy of the contacts that did not come back.
    pub(super) fn submit_copy(&mut self, missing: Range<u32>) -> Result<(), GpuError> {
        let encoder = (self.gpu.device).create_command_encoder(&Default::default());
        self.ask(encoder, missing, false)
    }

    /// Zeroes the arena from word `from` to the ends of the pixels: all in it that is counted. What lies behind is
    /// written before it is read. The tiles and pixels that were foreseen are more than there are; to clear only
    /// those would take dispatches.
    fn clear(&mut self, encoder: &mut wgpu::CommandEncoder, from: u32, data: &BatchData) {
        let Some(work) = self.buffers.work.get() else {
            return;
        };
        let end = u64::from(data.pixels_at) + 2 * u64::from(data.pixels);
        let bytes = 4 * (end - u64::from(from));
        encoder.clear_buffer(work, 4 * u64::from(from), Some(bytes));
        self.traffic.filled += bytes;
    }

    /// Encodes the stages of a round.
    fn dispatch(&mut self, encoder: &mut wgpu::CommandEncoder, round: Round, data: &BatchData) {
        let Self {
            gpu,
            buffers,
            bind_groups,
            timer,
            traffic,
            ..
        } = self;
        let pipelines = gpu.pipelines();
        let by_survivor = direct(data.items.min(data.survivors.div_ceil(GROUP)));
        let dispatch = |pass: &mut wgpu::ComputePass, k: usize| {
            let Pipeline {
                stage, pipeline, ..
            } = &pipelines[k];
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &bind_groups[k], &[]);
            let (groups, words) = match stage.name {
                "columns_touch" => (&buffers.groups, TILE_GROUPS),
                "alloc" | "sweep" => (&buffers.groups, PIXEL_GROUPS),
                "ways_out" | "compare" => (&buffers.groups, IMAGE_GROUPS),
                "splat" => (&buffers.splat_groups, 0),
                name => {
                    let [x, y, z] = match name {
                        "cull" => direct(data.items),
                        "normals_alloc" => direct(data.cells.div_ceil(GROUP)),
                        "aim" => direct(data.pairs),
                        "further" => direct(data.pairs.div_ceil(GROUP)),
                        "columns_tiles" | "columns_pixels" => [1, 1, 1],
                        _ => by_survivor,
                    };
                    return pass.dispatch_workgroups(x, y, z);
                }
            };
            if let Some(groups) = groups.get() {
                pass.dispatch_workgroups_indirect(groups, 4 * u64::from(words));
            }
        };
        let is_of_round = |k: &usize| match round {
            Round::First => *k != FURTHER_FROM,
            Round::Further => *k >= FURTHER_FROM,
        };
        let stages = (0..pipelines.len())
            .filter(is_of_round)
            .filter(|k| is_needed(pipelines[*k].stage.name, data.cells > 0));
        traffic.dispatches += stages.clone().count() as u32;
        match timer {
            None => {
                let mut pass = encoder.begin_compute_pass(&Default::default());
                stages.for_each(|k| dispatch(&mut pass, k));
            }
            Some(timer) => {
                timer.begin();
                for k in stages {
                    let mut pass = timer.pass(encoder, pipelines[k].stage.name);
                    dispatch(&mut pass, k);
                }
                timer.resolve(encoder);
            }
        }
    }

    /// Submits what was encoded, and asks for what is counted, what is found of the pairs, and these contacts; those before
    /// them have come back.
    fn ask(
        &mut self,
        mut encoder: wgpu::CommandEncoder,
        contacts: Range<u32>,
        has_stages: bool,
    ) -> Result<(), GpuError> {
        let (Some(work), Some(found), Some(readback)) = (
            self.buffers.work.get(),
            self.buffers.found.get(),
            self.buffers.readback.get(),
        ) else {
            return Err(self.gpu.failed("nothing was submitted".to_owned()));
        };
        let counters = 4 * u64::from(COUNTERS);
        let [pairs, from, to] = [0, contacts.start, contacts.end].map(|n| self.read_bytes(n));
        encoder.copy_buffer_to_buffer(work, 0, readback, 0, counters);
        for part in [counters..pairs, from..to] {
            let (at, bytes) = (part.start, part.end.saturating_sub(part.start));
            if bytes > 0 {
                encoder.copy_buffer_to_buffer(found, at - counters, readback, at, bytes);
            }
        }
        let submission = self.gpu.queue.submit([encoder.finish()]);
        self.traffic.submissions += 1;
        self.traffic.read_back += pairs + to.saturating_sub(from);
        self.gpu.check()?;
        self.asked = Some(Asked {
            submission,
            answer: Answer::to_reading(readback.slice(..to.max(from))),
            times: (self.timer.as_ref().filter(|_| has_stages)).map(Timer::ask),
            contacts: contacts.end.max(contacts.start),
        });
        Ok(())
    }

    /// Bytes that come back with so many contacts: counters, pairs, contacts.
    pub(super) fn read_bytes(&self, contacts: u32) -> u64 {
        let pairs = u64::from(PAIR_WORDS) * self.upload.pairs_of.len() as u64;
        let contacts = u64::from(CONTACT_WORDS) * u64::from(contacts);
        4 * (u64::from(COUNTERS) + pairs + contacts)
    }

    /// Gives up what was asked for, and the buffers in which it would come: `wgpu` makes a buffer that is asked for again
    /// readable as soon as the first submission ends, with what that one wrote.
    pub(super) fn abandon(&mut self) {
        let Some(asked) = self.asked.take() else {
            return;
        };
        self.buffers.readback.give_up();
        if asked.times.is_some() {
            self.timer = Timer::new(&self.gpu, self.gpu.pipelines().len());
        }
    }

    /// Makes the bind groups, if a buffer is new.
    fn bind(&mut self) {
        let bound = self.buffers.bound(&self.resident);
        if bound == self.bound {
            return;
        }
        self.bind_groups.clear();
        for Pipeline { stage, layout, .. } in self.gpu.pipelines() {
            let entries: Vec<_> = (stage.bindings.iter())
                .filter_map(|&binding| {
                    Some(wgpu::BindGroupEntry {
                        binding,
                        resource: bound[binding as usize].as_ref()?.as_entire_binding(),
                    })
                })
                .collect();
            self.bind_groups.push(
                self.gpu
                    .device
                    .create_bind_group(&wgpu::BindGroupDescriptor {
                        label: Some(stage.name),
                        layout,
                        entries: &entries,
                    }),
            );
        }
        self.bound = bound;
    }
}
