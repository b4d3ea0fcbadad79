//! What follows from a device, and what is said where there is none. What devices compute is compared in
//! `train::device_tests`.

use super::{DecoderBackend, DeviceKind};
use crate::train::config::TrainConfig;
use crate::train::presets::Preset;

#[test]
fn a_graphics_device_brings_the_tensor_decoder_along() {
    let config = Preset::Tiny.config(3);
    let with = |overrides: &[&str]| {
        let config = config.with_overrides(overrides).unwrap();
        (config.device, config.decoder_backend)
    };
    assert_eq!(with(&[]), (DeviceKind::Flex, DecoderBackend::Kernels));
    assert_eq!(with(&["device=ndarray"]), (DeviceKind::Ndarray, DecoderBackend::Kernels));
    assert_eq!(with(&["device=wgpu"]), (DeviceKind::Wgpu, DecoderBackend::Tensors));
    // what is named stays, in either order
    for order in [["device=wgpu", "decoder_backend=kernels"], ["decoder_backend=kernels", "device=wgpu"]] {
        assert_eq!(with(&order), (DeviceKind::Wgpu, DecoderBackend::Kernels));
    }
    // in a file too: left out it follows the device, written it stays
    let text = config.with_overrides(&["device=cuda"]).unwrap().to_toml().unwrap();
    let line = "decoder_backend = \"tensors\"\n";
    assert!(text.contains(line), "{text}");
    let read = |text: &str| TrainConfig::from_toml(text).unwrap().decoder_backend;
    assert_eq!(read(&text), DecoderBackend::Tensors);
    assert_eq!(read(&text.replace(line, "")), DecoderBackend::Tensors);
    assert_eq!(read(&text.replace(line, "decoder_backend = \"kernels\"\n")), DecoderBackend::Kernels);
    assert_eq!(
        read(&config.to_toml().unwrap().replace("decoder_backend = \"kernels\"\n", "")),
        DecoderBackend::Kernels
    );
}

#[test]
fn a_device_that_is_missing_names_the_remedy() {
    let missing = [
        (DeviceKind::Ndarray, "ndarray", cfg!(feature = "ndarray")),
        (DeviceKind::Wgpu, "wgpu", cfg!(feature = "wgpu")),
        (DeviceKind::Cuda, "cuda", cfg!(feature = "cuda")),
    ];
    for (kind, name, _) in missing.into_iter().filter(|(.., compiled)| !compiled) {
        let message = kind.open().unwrap_err().to_string();
        for word in [name, "not compiled in", "the feature"] {
            assert!(message.contains(word), "{word} is missing in: {message}");
        }
    }
    assert!(DeviceKind::Flex.open().is_ok_and(|opened| !opened.software && opened.name == "flex"));
}
