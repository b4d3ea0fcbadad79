//! Runs that stop, die, or meet what another left.

use super::*;

#[test]
fn stopped_and_killed_runs_continue_to_the_bit() {
    continues_to_the_bit(Preset::Tiny.config(3), &[]);
}

#[test]
fn an_auto_decoder_continues_to_the_bit_too() {
    let config = Preset::Tiny.auto_decoder(3);
    continues_to_the_bit(config, &["latents.safetensors"]);
}

/// Who computes its part of a batch first changes nothing.
#[test]
fn a_run_on_two_devices_continues_to_the_bit_too() {
    let mut config = Preset::Tiny.config(3);
    config.devices = Devices::first(2);
    continues_to_the_bit(config, &[]);
}

fn continues_to_the_bit(config: TrainConfig, more: &[&str]) {
    let (folder, mut config) = setup_of(config, 4);
    let original = config.clone();
    config.report.checkpoint_every = 2;
    config.report.validate_every = 2;
    let [whole, stopped, killed] = ["whole", "stopped", "killed"].map(|name| folder.path().join(name));
    complete(&mut Trainer::create(&whole, config.clone(), "test").unwrap());

    let stop = AtomicBool::new(false);
    let mut trainer = Trainer::create(&stopped, config.clone(), "test").unwrap();
    let finish = trainer.run(&stop, &After { step: 3, stop: &stop, panic: false }).unwrap();
    assert_eq!((finish, trainer.steps_done()), (Finish::Stopped, 3));
    let message = Trainer::resume(&stopped, "test").unwrap_err().to_string();
    assert!(message.contains("at work here"), "a run has one trainer at a time: {message}");
    drop(trainer);
    let mut trainer = Trainer::resume(&stopped, "test").unwrap();
    assert_eq!(trainer.steps_done(), 3);
    complete(&mut trainer);

    let mut trainer = Trainer::create(&killed, config, "test").unwrap();
    let progress = After { step: 3, stop: &stop, panic: true };
    let run = catch_unwind(AssertUnwindSafe(|| trainer.run(&AtomicBool::new(false), &progress)));
    assert!(run.is_err());
    drop(trainer);
    let mut trainer = Trainer::resume(&killed, "test").unwrap();
    assert_eq!(trainer.steps_done(), 2, "the last checkpoint");
    complete(&mut trainer);

    for other in [&stopped, &killed] {
        let files = ["checkpoint/state.safetensors", "model.safetensors", "preview/step-000004.png"];
        for name in files.iter().chain(more) {
            assert!(file(&whole, name) == file(other, name), "{name} differs in {}", other.display());
        }
        assert_eq!(losses(&whole), losses(other));
    }
    // and another seed is another run
    let mut config = original;
    config.seed = 1;
    let path = folder.path().join("seed");
    complete(&mut Trainer::create(&path, config, "test").unwrap());
    assert_ne!(file(&whole, "checkpoint/state.safetensors"), file(&path, "checkpoint/state.safetensors"));
}

/// A stop that comes when a validation is due does not wait for it: the validation is made when the run goes on.
#[test]
fn a_validation_that_was_stopped_is_made_later() {
    let (folder, mut config) = setup(4);
    config.report.validate_every = 2;
    config.report.preview_every = 2;
    let [whole, stopped] = ["whole", "stopped"].map(|name| folder.path().join(name));
    complete(&mut Trainer::create(&whole, config.clone(), "test").unwrap());
    let stop = AtomicBool::new(false);
    let mut trainer = Trainer::create(&stopped, config, "test").unwrap();
    let finish = trainer.run(&stop, &After { step: 2, stop: &stop, panic: false }).unwrap();
    assert_eq!((finish, trainer.steps_done()), (Finish::Stopped, 2));
    assert_eq!(losses(&stopped).len(), 2, "two updates and no validation");
    assert!(!stopped.join("model.safetensors").exists() && !stopped.join("preview/step-000002.png").exists());
    drop(trainer);
    complete(&mut Trainer::resume(&stopped, "test").unwrap());
    assert_eq!(losses(&whole), losses(&stopped));
    for name in ["checkpoint/state.safetensors", "model.safetensors", "preview/step-000002.png"] {
        assert!(file(&whole, name) == file(&stopped, name), "{name} differs");
    }
}

#[test]
fn a_used_folder_and_a_damaged_checkpoint_are_refused() {
    let (folder, mut config) = setup(1);
    let out = folder.path().join("run");
    complete(&mut Trainer::create(&out, config.clone(), "test").unwrap());
    let message = Trainer::create(&out, config.clone(), "test").unwrap_err().to_string();
    assert!(message.contains("not empty") && message.contains("continue the run"), "{message}");
    let state = out.join("checkpoint/state.safetensors");
    let bytes = fs::read(&state).unwrap();
    fs::write(&state, &bytes[..bytes.len() / 2]).unwrap();
    let message = Trainer::resume(&out, "test").unwrap_err().to_string();
    assert!(message.contains("state.safetensors") && message.contains("damaged"), "{message}");
    config.data.folders = vec![folder.path().join("nowhere")];
    let message = Trainer::create(&folder.path().join("other"), config, "test").unwrap_err().to_string();
    assert!(message.contains("nowhere"), "{message}");
    assert!(!folder.path().join("other").exists(), "nothing is left behind");
}

#[test]
fn a_run_that_ended_while_it_began_can_be_begun_again() {
    let (folder, config) = setup(1);
    let out = folder.path().join("run");
    fs::create_dir_all(out.join("checkpoint")).unwrap();
    fs::write(out.join("checkpoint/.state.safetensors.0123456789abcdef-0.part"), "half").unwrap();
    assert!(is_free(&out).unwrap());
    complete(&mut Trainer::create(&out, config.clone(), "test").unwrap());
    assert!(leftovers(&out).unwrap().is_empty() && !is_free(&out).unwrap());
    // a checkpoint of work done is never overwritten
    fs::remove_file(out.join("config.toml")).unwrap();
    for name in ["metrics.jsonl", "model.safetensors"] {
        fs::remove_file(out.join(name)).unwrap();
    }
    fs::remove_dir_all(out.join("preview")).unwrap();
    assert!(Trainer::create(&out, config, "test").unwrap_err().to_string().contains("not empty"));
}
