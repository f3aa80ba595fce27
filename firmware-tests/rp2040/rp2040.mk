# Firmware for the RP2040 in the emulator rp2040js, which comes from npm.

RP2040 := $(BUILD)/rp2040
.PHONY: rp2040-emulator test-firmware-rp2040
rp2040-emulator:
	@scripts/need gcc-arm-none-eabi mbpoll
	@command -v npm >/dev/null || scripts/need nodejs npm
	@mkdir -p $(RP2040) && cp firmware-tests/rp2040/package*.json firmware-tests/rp2040/*.mjs $(RP2040)
	@[ $(RP2040)/node_modules -nt firmware-tests/rp2040/package-lock.json ] || npm --prefix $(RP2040) ci --silent --ignore-scripts --no-audit --no-fund
	@arm-none-eabi-gcc -mcpu=cortex-m0plus -mthumb -Os -ffreestanding -fno-tree-loop-distribute-patterns -nostdlib $(WARNINGS) \
		-Wl,--build-id=none -Wl,-Tfirmware-tests/rp2040/rom.ld firmware-tests/rp2040/rom.c -o $(RP2040)/rom.elf

test-firmware-rp2040: rp2040-emulator ## Run the server in Rust for a Pico in an emulator, over its USB, against libmodbus
	@examples/rust/rp2040/build $(RP2040)/rust.elf
	@firmware-tests/rp2040/check usb $(RP2040)/rust.elf
