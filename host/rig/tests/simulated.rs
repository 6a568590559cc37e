//! The in-process rig through the whole client: its functions, its refusals and their words, and its persistent data.

mod common;

use std::io::{Read, Write};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use common::{Faulty, Random, image};
use mortise_protocol::frame::Decoder;
use mortise_protocol::image::CRC;
use mortise_protocol::limits::MAX_CHUNK;
use mortise_protocol::message::{DeviceState, Refusal, ResetReason, ToDevice};
use mortise_protocol::parameter::{PARAMETERS, ParameterId};
use mortise_rig::{
    Client, Event, Flash, Patience, RigError, RigSpec, Transport, UploadProgress, begin_message,
    chunk_message, simulate,
};

fn connect(flash: &Flash) -> Client {
    let transport = simulate(flash, false).expect("a thread");
    Client::over(transport, "sim-fast", Patience::long(), None).expect("the rig greets")
}

fn connect_fast() -> Client {
    Client::connect(&RigSpec::Simulated { realtime: false }).expect("the rig greets")
}

fn words(result: Result<(), RigError>) -> String {
    result.expect_err("to be refused").to_string()
}

#[test]
fn says_what_it_is() {
    let client = connect_fast();
    let capabilities = client.capabilities();
    assert!(capabilities.simulated);
    assert_eq!(capabilities.tick_hz, 1000);
    assert_eq!(capabilities.scene, None);
    assert_eq!(capabilities.reset, ResetReason::PowerOn);
}

#[test]
fn parameters_are_kept_and_their_ranges_held() {
    let client = connect_fast();
    for row in PARAMETERS {
        assert_eq!(
            client.parameter(row.id).expect("an answer"),
            row.default,
            "{}",
            row.name
        );
    }
    let id = ParameterId::CouplingStiffness;
    client
        .request(ToDevice::SetParameter { id, value: 500.0 })
        .expect("in range");
    assert_eq!(client.parameter(id).expect("an answer"), 500.0);
    for value in [-1.0, 1e9, f32::NAN, f32::INFINITY] {
        let said = words(client.request(ToDevice::SetParameter { id, value }));
        assert!(
            said.contains("CouplingStiffness must be a number from 0 to 5000 N/m"),
            "{said}"
        );
    }
    assert_eq!(client.parameter(id).expect("an answer"), 500.0);
}

#[test]
fn arming_without_a_scene_says_what_to_do() {
    let client = connect_fast();
    let said = words(client.request(ToDevice::Arm));
    assert!(
        said.contains("arming was refused: there is no collision model on the board: upload one"),
        "{said}"
    );
}

#[test]
fn bad_scenes_are_refused_with_the_reason() {
    let client = connect_fast();
    let good = image(3000, 1);
    let upload = |bytes: &[u8]| client.upload(bytes, &mut |_| {});

    let said = words(upload(b"solid cube"));
    assert!(said.contains("are not a scene image"), "{said}");
    let said = words(upload(&[7; 500]));
    assert!(said.contains("not a scene image"), "{said}");

    let mut layout = good.clone();
    layout[8] = 99;
    assert!(matches!(
        upload(&layout),
        Err(RigError::Refused {
            reason: Refusal::SceneImage(_),
            ..
        })
    ));

    let mut damaged = good.clone();
    damaged[2000] ^= 1;
    let said = words(upload(&damaged));
    assert!(said.contains("scene image damaged"), "{said}");

    let said = words(client.request(ToDevice::SceneBegin {
        length: u32::MAX,
        crc: 0,
        layout: client.capabilities().scene_layout,
    }));
    assert!(said.contains("larger than the"), "{said}");

    let said = words(client.request(ToDevice::SceneCommit));
    assert!(said.contains("no upload is under way"), "{said}");

    assert_eq!(client.refresh_capabilities().expect("an answer").scene, None);
    upload(&good).expect("a sound scene");
    let scene = client.refresh_capabilities().expect("an answer").scene;
    assert_eq!(scene, Some(CRC.checksum(&good)));
}

#[test]
fn upload_tells_its_progress_to_the_end() {
    let client = connect_fast();
    let scene = image(10 * MAX_CHUNK, 2);
    let mut seen = Vec::new();
    client
        .upload(&scene, &mut |progress| seen.push(progress))
        .expect("room");
    assert_eq!(
        seen.last(),
        Some(&UploadProgress {
            sent: scene.len(),
            total: scene.len()
        })
    );
    assert!(seen.windows(2).all(|pair| pair[0].sent < pair[1].sent));
}

/// After a loss of power at any chunk, and after the last chunk before the commit, the old scene is found again.
#[test]
fn an_upload_cut_at_any_chunk_leaves_the_old_scene() {
    let (old, new) = (image(5 * MAX_CHUNK + 40, 3), image(9 * MAX_CHUNK + 8, 4));
    let flash = Flash::default();
    connect(&flash).upload(&old, &mut |_| {}).expect("room");
    let chunks = new.len().div_ceil(MAX_CHUNK);
    for cut in 0..=chunks {
        let client = connect(&flash);
        assert_eq!(
            client.capabilities().scene,
            Some(CRC.checksum(&old)),
            "before cut {cut}"
        );
        client
            .request(begin_message(&new).expect("an image"))
            .expect("room");
        for chunk in 0..cut {
            client
                .request(chunk_message(&new, chunk * MAX_CHUNK))
                .expect("in order");
        }
        drop(client);
        assert_eq!(
            connect(&flash).capabilities().scene,
            Some(CRC.checksum(&old)),
            "after cut {cut}"
        );
    }
    connect(&flash).upload(&new, &mut |_| {}).expect("room");
    assert_eq!(connect(&flash).capabilities().scene, Some(CRC.checksum(&new)));
}

#[test]
fn a_restart_keeps_scene_and_link() {
    let client = connect_fast();
    let scene = image(2000, 5);
    client.upload(&scene, &mut |_| {}).expect("room");
    let client = client.restart().expect("a restart");
    assert_eq!(client.capabilities().reset, ResetReason::Requested);
    assert_eq!(client.capabilities().scene, Some(CRC.checksum(&scene)));
    client.run(1).expect("still in lockstep");
}

#[test]
fn lockstep_runs_what_it_is_sent_and_repeats_itself() {
    let hashes: Vec<u64> = (0..2)
        .map(|_| {
            let client = connect_fast();
            client.upload(&image(1000, 6), &mut |_| {}).expect("room");
            let before = client.run(0).expect("nothing to run").tick;
            let ran = client.run(1234).expect("ticks");
            assert_eq!(ran.tick - before, 1234);
            ran.state_hash
        })
        .collect();
    assert_eq!(hashes[0], hashes[1]);
}

#[test]
fn telemetry_comes_at_the_rate_asked_for() {
    let client = connect_fast();
    client
        .request(ToDevice::SetTelemetry { every_ticks: 5 })
        .expect("taken");
    client.run(1000).expect("ticks");
    client
        .request(ToDevice::SetTelemetry { every_ticks: 0 })
        .expect("taken");
    let ticks: Vec<u32> = client
        .events()
        .try_iter()
        .filter_map(|event| match event {
            Event::Telemetry(sample) => Some(sample.tick),
            _ => None,
        })
        .collect();
    assert_eq!(ticks.len(), 200);
    assert!(ticks.windows(2).all(|pair| pair[1] - pair[0] == 5));
    assert_eq!(client.statistics(false).expect("an answer").dropped, 0);
}

#[test]
fn stop_reaches_a_running_board() {
    let client = Client::connect(&RigSpec::Simulated { realtime: true }).expect("the rig greets");
    client.upload(&image(1000, 7), &mut |_| {}).expect("room");
    client.request(ToDevice::Arm).expect("armed");
    client.stop().expect("sent");
    let stopped =
        std::iter::from_fn(|| client.events().recv_timeout(Duration::from_secs(10)).ok()).any(|event| {
            matches!(
                event,
                Event::State {
                    state: DeviceState::Stopped,
                    ..
                }
            )
        });
    assert!(stopped);
    assert_eq!(client.state(), DeviceState::Stopped);
    let said = words(client.request(ToDevice::Arm));
    assert!(said.contains("clear the stop first"), "{said}");
    client.request(ToDevice::ClearFault).expect("cleared");
    client.request(ToDevice::Arm).expect("armed again");
}

/// With one byte in 2,000 lost or changed, both ways, the scene still arrives complete.
#[test]
fn a_scene_arrives_over_a_bad_link() {
    let Transport { reader, writer, keep } = simulate(&Flash::default(), false).expect("a thread");
    let (to_noise, from_client) = mortise_rig::pipe();
    // A thread damages the bytes on their way to the board.
    let noise = std::thread::spawn(move || {
        let mut writer = writer;
        let mut from = Faulty {
            inner: from_client,
            random: Random(8),
            one_in: 2000,
        };
        let mut bytes = [0; 512];
        loop {
            match from.read(&mut bytes) {
                Ok(0) => return,
                Ok(count) => writer.write_all(&bytes[..count]).expect("the board lives"),
                Err(error) if error.kind() == std::io::ErrorKind::TimedOut => {}
                Err(_) => return,
            }
        }
    });
    let transport = Transport {
        reader: Box::new(Faulty {
            inner: reader,
            random: Random(9),
            one_in: 2000,
        }),
        writer: Box::new(to_noise),
        keep,
    };
    let patience = Patience {
        answer: Duration::from_millis(150),
        ..Patience::long()
    };
    let client = Client::over(transport, "sim over a bad link", patience, None).expect("the rig greets");
    let scene = image(100 * MAX_CHUNK, 10);
    client.upload(&scene, &mut |_| {}).expect("it arrives");
    let found = client.refresh_capabilities().expect("an answer").scene;
    assert_eq!(found, Some(CRC.checksum(&scene)));
    assert!(client.link_counts().bad_frames > 0, "the link was not bad at all");
    drop(client);
    noise.join().expect("the noise ends with the link");
}

/// Loses the commit, or everything the board sends for a while from the commit on.
struct Losing<Inner> {
    inner: Inner,
    from: Arc<Mutex<Option<Instant>>>,
    lost: bool,
}

/// Longer than a simulated board takes to answer, shorter than the client waits.
const LOSS: Duration = Duration::from_millis(60);

impl<Inner: Read> Read for Losing<Inner> {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        loop {
            let count = self.inner.read(bytes)?;
            let within = (*self.from.lock().unwrap()).is_some_and(|from| from.elapsed() < LOSS);
            if count == 0 || !within {
                return Ok(count);
            }
        }
    }
}

impl<Inner: Write> Write for Losing<Inner> {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let mut decoder = Decoder::new();
        let commit = bytes.iter().any(|&byte| {
            let frame = decoder.push::<ToDevice>(byte);
            matches!(frame, Some(Ok((_, ToDevice::SceneCommit))))
        });
        let mut from = self.from.lock().unwrap();
        if commit && from.is_none() {
            *from = Some(Instant::now());
            if self.lost {
                return Ok(bytes.len());
            }
        }
        self.inner.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.inner.flush()
    }
}

/// The commit or its answer is lost: the scene is in use nevertheless, and an incomplete one is still refused.
#[test]
fn a_lost_commit_and_a_lost_answer_are_made_good() {
    for lost in [true, false] {
        let Transport { reader, writer, keep } = simulate(&Flash::default(), false).expect("a thread");
        let from = Arc::new(Mutex::new(None));
        let losing = |lost| (from.clone(), lost);
        let ((from_reader, _), (from_writer, lost)) = (losing(false), losing(lost));
        let transport = Transport {
            reader: Box::new(Losing {
                inner: reader,
                from: from_reader,
                lost: false,
            }),
            writer: Box::new(Losing {
                inner: writer,
                from: from_writer,
                lost,
            }),
            keep,
        };
        let patience = Patience {
            answer: Duration::from_millis(300),
            ..Patience::long()
        };
        let client =
            Client::over(transport, "sim that loses one frame", patience, None).expect("the rig greets");
        let scene = image(3 * MAX_CHUNK, 11);
        client.upload(&scene, &mut |_| {}).expect("it arrives");
        assert!(from.lock().unwrap().is_some(), "nothing was lost");
        let found = client.refresh_capabilities().expect("an answer").scene;
        assert_eq!(found, Some(CRC.checksum(&scene)), "commit lost: {lost}");
    }
}
