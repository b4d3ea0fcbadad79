//! Runs on panoramas that are in a file.

use super::*;
use veni_data::PixelStorage;

/// The run with all panoramas in files.
fn beyond_memory(config: &TrainConfig) -> TrainConfig {
    let mut config = config.clone();
    config.data.memory_mib = 0;
    config
}

#[test]
fn a_run_on_mapped_panoramas_is_the_run_in_memory_to_the_bit() {
    let mut mixing = Preset::Tiny.config(3);
    (mixing.augment.mix, mixing.augment.mix_share) = (0.5, 0.5);
    for (config, latents) in [(mixing, None), (Preset::Tiny.auto_decoder(3), Some("latents.safetensors"))] {
        let (folder, mut config) = setup_of(config, 4);
        config.report.validate_every = 2;
        let [memory, file] = ["memory", "file"].map(|name| folder.path().join(name));
        let mut trainer = Trainer::create(&memory, config.clone(), "test").unwrap();
        assert_eq!(trainer.mapped_bytes(), 0);
        complete(&mut trainer);
        let mut trainer = Trainer::create(&file, beyond_memory(&config), "test").unwrap();
        assert_eq!(trainer.mapped_bytes(), 3 * 12 * (config.data.width * config.data.height) as u64);
        complete(&mut trainer);
        let names = ["checkpoint/state.safetensors", "model.safetensors", "preview/step-000004.png"];
        for name in names.into_iter().chain(latents) {
            assert!(self::file(&memory, name) == self::file(&file, name), "{name}");
        }
        assert_eq!(losses(&memory), losses(&file));
        let mut left: Vec<_> =
            fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        left.sort();
        assert_eq!(left, ["data", "file", "memory"], "the file has no name");
    }
}

#[test]
fn panoramas_of_a_stage_have_a_file_of_their_own() {
    let (folder, config) = setup(4);
    let stages = format!(
        "\n[[stage]]\nname = \"a\"\nsteps = 2\ndata.folders = [{:?}]\ndata.memory_mib = 0\n\
         \n[[stage]]\nname = \"b\"\nsteps = 2\n",
        folder.path().join("data/train")
    );
    let config = TrainConfig::from_toml(&(config.to_toml().unwrap() + &stages)).unwrap();
    let mut trainer = Trainer::create(&folder.path().join("run"), config.clone(), "test").unwrap();
    assert_eq!(trainer.mapped_bytes(), 2 * 12 * (config.data.width * config.data.height) as u64);
    complete(&mut trainer);
    assert_eq!(trainer.mapped_bytes(), 0, "it goes with the stage");
}

/// The disk that a run was begun on is gone, and the memory of the next machine is small.
#[test]
fn a_resumed_run_holds_its_panoramas_elsewhere_and_ends_with_the_same_weights() {
    let (folder, mut config) = setup(4);
    config.report.checkpoint_every = 2;
    let [whole, moved, scratch] = ["whole", "moved", "scratch"].map(|name| folder.path().join(name));
    fs::create_dir(&scratch).unwrap();
    let gone = folder.path().join("gone");
    let stages = format!(
        "\n[[stage]]\nname = \"a\"\nsteps = 3\ndata.memory_mib = 0\ndata.scratch = {gone:?}\n\
         \n[[stage]]\nname = \"b\"\nsteps = 1\n"
    );
    let (width, height) = (config.data.width, config.data.height);
    let config = TrainConfig::from_toml(&(config.to_toml().unwrap() + &stages)).unwrap();
    fs::create_dir(&gone).unwrap();
    complete(&mut Trainer::create(&whole, config.clone(), "test").unwrap());
    let stop = AtomicBool::new(false);
    let mut trainer = Trainer::create(&moved, config, "test").unwrap();
    trainer.run(&stop, &After { step: 2, stop: &stop, panic: false }).unwrap();
    drop(trainer);
    let settings = file(&moved, "config.toml");
    fs::remove_dir(&gone).unwrap();
    assert!(Trainer::resume(&moved, "test").unwrap_err().to_string().contains("gone"));
    let panorama = 12 * (width * height) as u64;
    for (memory_mib, mapped) in [(Some(100), 0), (None, 2 * panorama), (Some(0), (3 + 2) * panorama)] {
        let storage = PixelStorage { memory_mib, scratch: Some(scratch.clone()) };
        let mut trainer =
            Trainer::resume_with(&moved, "test", &storage, &veni_light::progress::Silent).unwrap();
        assert_eq!(trainer.mapped_bytes(), mapped, "{memory_mib:?}");
        if memory_mib == Some(0) {
            complete(&mut trainer);
        }
    }
    assert!(file(&moved, "config.toml") == settings);
    for name in ["checkpoint/state.safetensors", "model.safetensors"] {
        assert!(file(&whole, name) == file(&moved, name), "{name}");
    }
}

#[test]
fn a_set_that_cannot_be_held_leaves_no_run() {
    let (folder, config) = setup(4);
    let mut config = beyond_memory(&config);
    config.data.scratch = Some(folder.path().join("missing"));
    let out = folder.path().join("run");
    let message = Trainer::create(&out, config, "test").unwrap_err().to_string();
    assert!(message.contains("missing") && message.contains("data.scratch"), "{message}");
    assert!(!out.exists());
}
