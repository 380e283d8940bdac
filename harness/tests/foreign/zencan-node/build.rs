//! Generates the dictionary of the device.

fn main() {
    zencan_build::build_node_from_device_config("DEVICE", "device.toml")
        .expect("device.toml is what zencan-build can read");
}
