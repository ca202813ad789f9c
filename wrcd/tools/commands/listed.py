"""Every command of wrcd: a new one is an import and an entry here."""

from wrcd.tools.command import Command
from wrcd.tools.commands import (
    check_command,
    dump_command,
    init_command,
    kit_command,
    lint_command,
    reload_command,
    replay_command,
    run_command,
)
from wrcd.tools.completion import completion_of
from wrcd.tools.install import command as install_command
from wrcd.tools.monitor import command as monitor_command
from wrcd.tools.report import command as report_command
from wrcd.tools.story import plot_command, why_command

# in the order of the help
COMMANDS: tuple[Command, ...] = (
    run_command.COMMAND,
    reload_command.COMMAND,
    check_command.COMMAND,
    dump_command.COMMAND,
    monitor_command.COMMAND,
    replay_command.COMMAND,
    report_command.COMMAND,
    plot_command.COMMAND,
    why_command.COMMAND,
    init_command.COMMAND,
    lint_command.COMMAND,
    kit_command.COMMAND,
    *install_command.COMMANDS,
    completion_of("wrcd"),
)
