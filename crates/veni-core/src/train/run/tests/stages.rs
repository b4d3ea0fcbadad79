//! Runs of several stages.

use super::*;

/// The run with `[[stage]]` sections as they stand in a file.
fn staged(config: &TrainConfig, stages: &str) -> TrainConfig {
    let text = config.to_toml().unwrap() + stages;
    TrainConfig::from_toml(&text).unwrap_or_else(|e| panic!("{e}"))
}

#[test]
fn a_single_stage_is_the_run_without_stages() {
    let (folder, config) = setup(6);
    let [plain, one] = ["plain", "one"].map(|name| folder.path().join(name));
    complete(&mut Trainer::create(&plain, config.clone(), "test").unwrap());
    let config = staged(&config, "\n[[stage]]\nname = \"all\"\nsteps = 6\n");
    complete(&mut Trainer::create(&one, config, "test").unwrap());
    for name in ["checkpoint/state.safetensors", "model.safetensors", "preview/step-000006.png"] {
        assert!(file(&plain, name) == file(&one, name), "{name}");
    }
}

#[test]
fn each_stage_has_its_own_data_rates_and_schedules() {
    let (folder, mut config) = setup(7);
    // other skies, and one that validates the run
    let first = folder.path().join("first");
    fs::create_dir(&first).unwrap();
    for (name, azimuth) in [("d", 1.0), ("e", 5.0)] {
        let path = first.join(name).with_extension("exr");
        sky(azimuth).write(&path, &WriteOptions::new(WriteFormat::Exr(Precision::Float))).unwrap();
    }
    config.report.validate_every = 0;
    let stages = format!(
        "\n[[stage]]\nname = \"a\"\nsteps = 4\nbatch = 1\ndata.folders = [{first:?}, {:?}]\nloss.kld = 0\n\
         \n[[stage]]\nname = \"b\"\nsteps = 3\ndecoder.learning_rate.rate = 0.25\ndecoder.learning_rate.warm_up = 1\n",
        folder.path().join("data/val/c.exr")
    );
    let config = staged(&config, &stages);
    let out = folder.path().join("run");
    let mut trainer = Trainer::create(&out, config.clone(), "test").unwrap();
    let own = trainer.stages[0].data.as_ref().unwrap();
    let names: Vec<_> = own.items().iter().map(veni_data::Item::name).collect();
    assert_eq!(names, ["d", "e"], "what validates is not trained on");
    complete(&mut trainer);
    let text = String::from_utf8(file(&out, "metrics.jsonl")).unwrap();
    let lines: Vec<serde_json::Value> = text.lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    let updates: Vec<_> = lines.iter().filter(|line| line.get("loss").is_some()).collect();
    let stages: Vec<_> = updates.iter().map(|line| line["stage"].as_str().unwrap()).collect();
    assert_eq!(stages.concat(), "aaaabbb");
    assert_eq!(
        updates.iter().map(|line| line["step"].as_u64().unwrap()).collect::<Vec<_>>(),
        [1, 2, 3, 4, 5, 6, 7]
    );
    assert!(updates[..4].iter().all(|line| line["parts"].get("kld").is_none()));
    assert!(updates[4..].iter().all(|line| line["parts"].get("kld").is_some()));
    // rates count from the stage's first update, and fall until its last
    let rate = |at: usize| updates[at]["learning_rate"]["decoder"].as_f64().unwrap();
    assert_eq!((rate(0), rate(4), rate(5)), (0.0, 0.0, 0.25));
    let LearningRate::Cosine { rate: high, warm_up, floor, .. } = config.decoder.learning_rate else {
        panic!("tiny's schedule")
    };
    let own = LearningRate::Cosine { rate: high, warm_up, steps: 4, floor, periodic: false };
    assert_eq!(rate(3), own.at(3));
    // validated where a stage ends
    let validations = lines.iter().filter(|line| line.get("validation").is_some());
    assert_eq!(validations.map(|line| line["step"].as_u64().unwrap()).collect::<Vec<_>>(), [4, 7]);
    let training = Model::load(out.join("model.safetensors")).unwrap().info().training.clone().unwrap();
    assert_eq!(training.data, "2 panoramas of data; a: first, c.exr");
}
