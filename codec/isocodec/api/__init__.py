"""The public interface: functions and objects that users call."""
