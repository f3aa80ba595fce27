fn main() {
    cc::Build::new()
        .file("src/callgrind.c")
        .compile("callgrind");
    println!("cargo:rerun-if-changed=src/callgrind.c");
}
