# The Arduino library, and sketches on simulated AVR boards.

# BOARDS names boards or families of boards, for a library without the others and their compilers.
assembler library arduino-zip: export MBM_BOARDS := $(BOARDS)

.PHONY: assembler
assembler: ## Write the library as assembler source, one file for each instruction set, build/assembler; BOARDS="uno esp32" for some
	@$(NEED_PYTHON)
	@scripts/build/assembler

.PHONY: library
library: assembler
	@packaging/arduino/library

.PHONY: arduino-zip
arduino-zip: library ## Pack the Arduino library into a zip in dist/; BOARDS="uno pico" for these boards alone
	@mkdir -p dist
	@packaging/arduino/pack dist

.PHONY: arduino
arduino: arduino-zip ## Pack the Arduino library, and assemble it for every processor that it serves
	@packaging/arduino/check
	@scripts/check/assembler

.PHONY: need-avr
need-avr:
	@scripts/need gcc libc6-dev arduino-builder arduino-core-avr arduino-ctags gcc-avr avr-libc binutils-avr \
	    libsimavr-dev libelf-dev pkg-config libmodbus-dev libcmocka-dev

# Not part of `make test`, because the sketches and that library are not in the repository.
.PHONY: check-sketches
check-sketches: need-avr library ## Compile the sketches in the folder SKETCHES with the library in MODBUSMASTER and with mbm
	@scripts/need gcc-xtensa-lx106 gcc-arm-none-eabi libnewlib-arm-none-eabi libstdc++-arm-none-eabi-newlib
	@firmware-tests/avr/check-sketches "$(MODBUSMASTER)" "$(SKETCHES)" $(BUILD)/sketches.md

# Not part of `make test` either, because the cores are not in the repository. docs/maintainers/boards.md says which were tried.
.PHONY: check-core
check-core: library ## Examples with a real Arduino core: CORE, its tree in FOLDER; LIBRARIES, PROPERTIES as NAME=VALUE
	@scripts/need python3 arduino-builder arduino-ctags gcc-avr avr-libc gcc-arm-none-eabi libnewlib-arm-none-eabi \
	    libstdc++-arm-none-eabi-newlib gcc-xtensa-lx106
	@scripts/check/core "$(CORE)" "$(FOLDER)" $(LIBRARIES) $(PROPERTIES)

# --- sketches, each for the boards that a test runs it on

AVR_OUT := $(BUILD)/avr
ARDUINO_EXAMPLES := $(notdir $(wildcard examples/arduino/*))
# These need more flash or RAM than an Uno or a Leonardo has.
LARGE_EXAMPLES := Sniffer TcpToRtuGateway
SMALL_EXAMPLES := $(filter-out $(LARGE_EXAMPLES),$(ARDUINO_EXAMPLES))
# These need more than one UART.
MEGA_SKETCHES := TwoPorts OlderCalls TestPorts
TEST_SKETCHES := $(notdir $(wildcard firmware-tests/avr/sketches/*))
AVR_ELFS := $(SMALL_EXAMPLES:%=$(AVR_OUT)/uno/%.elf) $(ARDUINO_EXAMPLES:%=$(AVR_OUT)/mega/%.elf) \
            $(SMALL_EXAMPLES:%=$(AVR_OUT)/leonardo/%.elf) $(AVR_OUT)/leonardo/UsbTypes.elf \
            $(patsubst %,$(AVR_OUT)/uno/%.elf,$(filter-out $(MEGA_SKETCHES),$(TEST_SKETCHES))) \
            $(MEGA_SKETCHES:%=$(AVR_OUT)/mega/%.elf) $(AVR_OUT)/mega/Rates.elf $(AVR_OUT)/mega/Silences.elf
# Sketches that run with shortened calls and jumps too.
RELAX_ELFS := $(patsubst %,$(AVR_OUT)/uno-relax/%.elf,SizeSerial SizeFC03 Basic PhoenixContact Probe \
              ServeSensorAndRelay) \
              $(patsubst %,$(AVR_OUT)/mega-relax/%.elf,Basic PhoenixContact ServeSensorAndRelay)
# Other chips of the set avr5 that the simulator knows: some with two UARTs, some with one.
CHIPS := mega1280 atmega644p atmega1284p atmega328 atmega644
CHIP_ELFS := $(foreach chip,$(CHIPS),$(patsubst %,$(AVR_OUT)/$(chip)/%.elf,FirstRead WriteAndReadBack))
# A sketch that waits for replies of 125 registers.
WIDE_ELFS := $(AVR_OUT)/uno-125/TimeWait.elf
# With MODBUSMASTER, the folder of that library: the sketches that measure it.
PEER_ELFS := $(if $(MODBUSMASTER),$(patsubst %,$(AVR_OUT)/uno-peer/%.elf,TimeRead TimeBasicNoGap SizeFC03 \
                Basic PhoenixContact TimeUnchanged TimeLong))
# A copy of the library with which the sketches were last compiled.
LIBRARY_STAMP := $(BUILD)/avr/library

.PHONY: library-stamp
library-stamp: library
	@mkdir -p $(AVR_OUT)
	@tar --sort=name --mtime=@0 -cf $(LIBRARY_STAMP).new -C $(BUILD)/arduino mbm
	@cmp -s $(LIBRARY_STAMP).new $(LIBRARY_STAMP) || cp $(LIBRARY_STAMP).new $(LIBRARY_STAMP)

.PHONY: avr-sketches
avr-sketches: library-stamp
	@$(MAKE) -s --no-print-directory $(BARE) $(AVR_ELFS) $(RELAX_ELFS) $(CHIP_ELFS) $(WIDE_ELFS) $(PEER_ELFS)

# The examples are compiled from their copies in the library.
SKETCH_SOURCES := firmware-tests/avr/compile-sketch $(wildcard firmware-tests/avr/sketches/*/*.ino firmware-tests/avr/libraries/*/src/*)
define sketches
$(AVR_OUT)/$(1)/%.elf: examples/arduino/%/ $(SKETCH_SOURCES) $(LIBRARY_STAMP)
	@firmware-tests/avr/compile-sketch $(1) $(BUILD)/arduino/mbm/examples/$$* $$@
$(AVR_OUT)/$(1)/%.elf: firmware-tests/avr/sketches/%/ $(SKETCH_SOURCES) $(LIBRARY_STAMP)
	@firmware-tests/avr/compile-sketch $(1) $$< $$@
endef
$(eval $(call sketches,uno))
$(eval $(call sketches,mega))
# The tests do not run these, because the simulator has no USB for Serial.
$(eval $(call sketches,leonardo))
$(foreach chip,$(CHIPS),$(eval $(call sketches,$(chip))))
$(eval $(call sketches,uno-125))
$(eval $(call sketches,uno-relax))
$(eval $(call sketches,mega-relax))
$(eval $(call sketches,uno-peer))
$(PEER_ELFS): $(wildcard $(MODBUSMASTER)/src/*)

# The examples of ModbusMaster, in the folder SKETCHES.
UPSTREAM := $(patsubst %,upstream-%,basic-2 phoenix-2 halfduplex-2 basic-09 phoenix-09)
UPSTREAM_BOARDS := uno mega atmega1284p
define upstream
$(AVR_OUT)/$(1)/upstream-%.elf: $(SKETCHES)/upstream-% firmware-tests/avr/compile-sketch $(LIBRARY_STAMP)
	@firmware-tests/avr/compile-sketch $(1) $$< $$@
endef
$(foreach board,$(UPSTREAM_BOARDS),$(eval $(call upstream,$(board))))
# The same with ModbusMaster itself. Those of the manual for 0.9 need the release that they are of.
define upstream-peer
$(AVR_OUT)/$(1)/upstream-%-09.elf: $(SKETCHES)/upstream-%-09 firmware-tests/avr/compile-sketch
	@MODBUSMASTER=$(MODBUSMASTER_09) firmware-tests/avr/compile-sketch $(1) $$< $$@
$(AVR_OUT)/$(1)/upstream-%.elf: $(SKETCHES)/upstream-% firmware-tests/avr/compile-sketch
	@firmware-tests/avr/compile-sketch $(1) $$< $$@
endef
$(eval $(call upstream-peer,uno-peer))
$(eval $(call upstream-peer,mega-peer))

# The code for avrxmega3 in a program for another chip, because no simulator has an avrxmega3.
BARE := $(AVR_OUT)/avrxmega3/Bare.elf
$(BARE): firmware-tests/avr/bare/bare.c $(BUILD)/assembler/mbm_avrxmega3.S $(wildcard include/mbm/*.h)
	@mkdir -p $(@D)
	@avr-gcc -mmcu=atmega1284p -U__AVR_ARCH__ -D__AVR_ARCH__=103 -c $(BUILD)/assembler/mbm_avrxmega3.S -o $(@D)/mbm.o
	@avr-gcc -mmcu=atmega1284p -std=c11 -Os $(WARNINGS) -Iinclude -Wl,--gc-sections $< $(@D)/mbm.o -o $@

# --- the programs that run the sketches

AVR_SUPPORT := $(patsubst %,$(BUILD)/avr-tests/%.o,board bus sketch server pty tcp_server)
AVR_TESTS := $(patsubst firmware-tests/avr/%.c,$(BUILD)/avr-tests/%,$(wildcard firmware-tests/avr/test_*.c))
AVR_FLAGS = -std=c11 -O2 -g $(TEST_WARNINGS) -Ifirmware-tests/avr -Ic-tests/support -Iinclude -isystem /usr/include/simavr $(MODBUS)

$(BUILD)/avr-tests/%.o: firmware-tests/avr/%.c
	@mkdir -p $(@D)
	@gcc $(DEPENDS) $(AVR_FLAGS) -c $< -o $@
$(BUILD)/avr-tests/%.o: c-tests/support/%.c
	@mkdir -p $(@D)
	@gcc $(DEPENDS) $(AVR_FLAGS) -c $< -o $@
TIMING := $(BUILD)/avr-tests/timing
TIMING_PARTS := $(patsubst firmware-tests/avr/%.c,$(BUILD)/avr-tests/%.o,$(wildcard firmware-tests/avr/timing_*.c))
$(TIMING): $(TIMING_PARTS)
$(AVR_TESTS): $(BUILD)/avr-tests/test.o
$(AVR_TESTS) $(TIMING): %: %.o $(AVR_SUPPORT)
	@gcc $^ -lsimavr -lelf -lmodbus -lcmocka -lpthread -o $@

.PHONY: avr-tests
avr-tests: $(AVR_TESTS)

.PHONY: test-firmware-avr
test-firmware-avr: need-avr
	@$(MAKE) -s --no-print-directory avr-sketches avr-tests
	@MBM_TEST_JOBS=1 MBM_TEST_SECONDS=1200 scripts/check/run-c-tests $(AVR_TESTS)

UPSTREAM_TEST := $(BUILD)/avr-tests/upstream
UPSTREAM_WIRE := $(BUILD)/avr-tests/upstream_wire
$(UPSTREAM_TEST): $(BUILD)/avr-tests/test.o
$(UPSTREAM_TEST) $(UPSTREAM_WIRE): %: %.o $(BUILD)/avr-tests/upstream_device.o $(AVR_SUPPORT)
	@gcc $^ -lsimavr -lelf -lmodbus -lcmocka -lpthread -o $@
.PHONY: test-firmware-upstream
test-firmware-upstream: need-avr library-stamp ## The examples of ModbusMaster, in the folder SKETCHES, on simulated boards
	@$(MAKE) -s --no-print-directory $(UPSTREAM_TEST) \
		$(foreach board,$(UPSTREAM_BOARDS),$(UPSTREAM:%=$(AVR_OUT)/$(board)/%.elf))
	@MBM_TEST_SECONDS=1200 scripts/check/run-c-tests $(UPSTREAM_TEST)

.PHONY: compare-upstream
compare-upstream: need-avr library-stamp ## The wire of ModbusMaster's examples, in SKETCHES, with MODBUSMASTER and MODBUSMASTER_09 and with mbm; writes docs/reports/timing.md
	@$(MAKE) -s --no-print-directory $(UPSTREAM_WIRE) \
		$(foreach board,uno mega uno-peer mega-peer,$(UPSTREAM:%=$(AVR_OUT)/$(board)/%.elf))
	@for example in basic-2:2 phoenix-2:1 halfduplex-2:1 basic-09:2 phoenix-09:1; do \
		$(UPSTREAM_WIRE) $${example%:*} $${example#*:} || exit 1; \
	done >$(BUILD)/avr-tests/upstream.rows
	@{ echo "| example | board | frames | bytes, the same | ms from one frame to the next, mbm | ModbusMaster |"; \
		echo "|---|---|---|---|---|---|"; cat $(BUILD)/avr-tests/upstream.rows; } | scripts/fill docs/reports/timing.md upstream
	@echo "compare-upstream: ten sketches put the same bytes on the wire with both libraries; docs/reports/timing.md has the times"

.PHONY: timing
timing: need-avr ## Measure bus timing, RAM and flash on a simulated Uno; writes docs/reports/timing.md
	@$(MAKE) -s --no-print-directory avr-sketches $(TIMING)
	@scripts/bench/timing

.PHONY: check-timing
check-timing: need-avr ## Compare bus timing, RAM and flash on a simulated Uno with docs/reports/timing.md
	@$(MAKE) -s --no-print-directory avr-sketches $(TIMING)
	@scripts/bench/timing --check
